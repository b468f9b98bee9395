/* The Tab key reaches the elements that can be scrolled, and no others. */
const reach = () => document.querySelectorAll(".wide, .drawing, .equation").forEach(
  (box) => box.scrollWidth > box.clientWidth
    ? box.setAttribute("tabindex", 0) : box.removeAttribute("tabindex"));
addEventListener("resize", reach);
reach();
