// What scrolls by itself can be reached by the Tab key, and then be moved by arrow keys.
"use strict";
(() => {
  const boxes = "pre, .table-wrapper, div.math, .cell_output";
  function mark() {
    for (const box of document.querySelectorAll(boxes)) {
      const scrolls = ["auto", "scroll"].includes(getComputedStyle(box).overflowX) &&
        (box.scrollWidth > box.clientWidth || box.scrollHeight > box.clientHeight);
      if (scrolls) {
        box.tabIndex = 0;
        box.setAttribute("role", "group");
        box.setAttribute("aria-label", "scrolls sideways");
      } else if (box.getAttribute("aria-label") === "scrolls sideways") {
        for (const name of ["tabindex", "role", "aria-label"]) box.removeAttribute(name);
      }
    }
  }
  addEventListener("load", mark);
  addEventListener("resize", mark);
})();
