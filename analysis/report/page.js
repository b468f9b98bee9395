/* Lets the Tab key reach exactly those elements that can be scrolled. */
const reach = () => document.querySelectorAll(".wide, .drawing, .equation").forEach(
  (box) => box.scrollWidth > box.clientWidth
    ? box.setAttribute("tabindex", 0) : box.removeAttribute("tabindex"));
addEventListener("resize", reach);
reach();
