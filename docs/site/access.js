// What the theme leaves out for those who use keys or have pages read to them: names, places that Tab reaches, tables' empty corners.

let numbered = 0;

const MENDED = {
  ".md-search[role=dialog]:not([aria-label])": (e) => e.setAttribute("aria-label", "Search"),
  ".md-typeset :is(pre > code, .md-typeset__scrollwrap, div.output):not([tabindex='0'])": (e) => { e.tabIndex = 0; },
  ".md-typeset th:empty": (e) => e.replaceWith(document.createElement("td")),
  ":is(.md-code__nav, .md-nav .md-nav):not([data-numbered])": number,
};

// Landmarks of one kind have different names.
function number(nav) {
  const label = document.getElementById(nav.getAttribute("aria-labelledby"))?.textContent ?? nav.ariaLabel ?? "Code";
  nav.removeAttribute("aria-labelledby");
  nav.setAttribute("aria-label", `${label.trim()} ${++numbered}`);
  nav.dataset.numbered = "";
}

function mend() {
  for (const [selector, how] of Object.entries(MENDED)) document.querySelectorAll(selector).forEach(how);
}

document.addEventListener("DOMContentLoaded", mend);
new MutationObserver(mend).observe(document.documentElement, { childList: true, subtree: true, attributeFilter: ["tabindex"] });
