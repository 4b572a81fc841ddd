// A region that scrolls takes the focus, so that the keyboard can scroll it.
function focusable() {
  const regions = [...document.querySelectorAll("pre, .table-wrapper, article dt")];
  const scrolls = regions.map((region) => region.scrollWidth > region.clientWidth); // all reads first: one layout
  regions.forEach((region, k) => (scrolls[k] ? region.setAttribute("tabindex", "0") : region.removeAttribute("tabindex")));
}
addEventListener("load", focusable);
addEventListener("resize", focusable);
