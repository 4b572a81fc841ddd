// Readers with scripts: the contents list follows them, tables of cases are filtered and sorted, tables and figures are
// saved, and paper has no folds. Scripts of animations stand below.
"use strict";
(() => {
  document.documentElement.classList.add("js");
  const make = (tag, attributes = {}, ...inside) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...inside);
    return element;
  };

  // the contents list shows where the reader is
  const links = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) links.get(entry.target.id)?.classList.toggle("here", entry.isIntersecting);
  }, { rootMargin: "-30% 0px -65% 0px" });
  for (const section of document.querySelectorAll("main > section")) seen.observe(section);

  // tables of cases: words, a verdict and a cause filter; a head sorts within each cause
  const number = (text) => parseFloat(text.replaceAll("\u2212", "-").replaceAll(",", ""));
  function listing(piece) {
    const table = piece.querySelector("table"), groups = [...table.tBodies];
    const rows = groups.map((group) => [...group.rows].slice(1));
    const words = make("input", { type: "search" });
    const verdict = make("select", {}, make("option", { value: "" }, "all"));
    const cause = make("select", {}, make("option", { value: "" }, "all"));
    const said = make("output");
    for (const one of new Set(rows.flat().map((row) => row.cells[1].textContent))) verdict.append(make("option", {}, one));
    for (const group of groups) cause.append(make("option", { value: group.id }, group.rows[0].textContent));
    const labelled = (text, field) => make("label", {}, text, field);
    table.parentElement.before(make("div", { class: "controls" }, labelled("Search", words),
      labelled("Verdict", verdict), labelled("Cause", cause), said));
    function filter() {
      const wanted = words.value.toLowerCase();
      let shown = 0;
      groups.forEach((group, k) => {
        let mine = 0;
        for (const row of rows[k]) {
          row.hidden = Boolean((cause.value && cause.value !== group.id) || (verdict.value && verdict.value !== row.cells[1].textContent)
            || (wanted && !row.textContent.toLowerCase().includes(wanted)));
          mine += !row.hidden;
        }
        group.hidden = !mine;
        shown += mine;
      });
      said.textContent = `${shown} of ${rows.flat().length} shown`;
    }
    function sort(at, head) {
      const down = head.getAttribute("aria-sort") === "ascending", sign = down ? -1 : 1;
      for (const one of table.tHead.rows[0].cells) if (one.hasAttribute("aria-sort")) one.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      groups.forEach((group, k) => {
        const keyed = rows[k].map((row) => [row.cells[at].textContent, number(row.cells[at].textContent), row]);
        const plain = keyed.every(([text, value]) => text === "\u2013" || !isNaN(value));
        keyed.sort(plain ? (a, b) => isNaN(a[1]) - isNaN(b[1]) || sign * (a[1] - b[1]) || 0
          : (a, b) => sign * a[0].localeCompare(b[0], "en", { numeric: true }));
        group.append(...keyed.map((one) => one[2]));
      });
    }
    [...table.tHead.rows[0].cells].slice(0, -1).forEach((head, at) => {
      const button = make("button", { type: "button" }, ...head.childNodes);
      head.append(button);
      head.setAttribute("aria-sort", "none");
      button.addEventListener("click", () => sort(at, head));
    });
    words.addEventListener("input", filter);
    for (const choice of [verdict, cause]) choice.addEventListener("change", filter);
    filter();
    return { table, show: () => { words.value = verdict.value = cause.value = ""; filter(); } };
  }
  const listings = [...document.querySelectorAll(".failures")].map(listing);

  // a link to a case shows it, whatever is filtered away, with its commands
  function visit() {
    const target = document.getElementById(location.hash.slice(1));
    if (!target) return;
    for (let fold = target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    const mine = listings.find((one) => one.table.contains(target));
    if (mine && (target.hidden || target.parentElement.hidden)) mine.show();
    if (mine) for (const fold of target.querySelectorAll(":scope > td > details")) fold.open = true;
    target.scrollIntoView();
  }
  addEventListener("hashchange", visit);
  if (location.hash) visit();

  // tables as CSV, figures as SVG with the colours that they have here
  function save(name, kind, text) {
    const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: kind })), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
  const file = (name, ending) => `${name.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 60) || "table"}.${ending}`;
  const quoted = (text) => { // what a spreadsheet would compute stays text
    const plain = /^[=+@]/.test(text) ? `'${text}` : text;
    return /[",\n\r]/.test(plain) ? `"${plain.replaceAll('"', '""')}"` : plain;
  };
  function csv(table) {
    const cell = (one) => quoted(one.innerText.trim().replaceAll("\u2212", "-"));
    const grouped = table.matches(".cases");
    const heads = [...table.tHead.rows].at(-1);
    const lines = [[...heads.cells].map((one) => quoted(one.textContent)).concat(grouped ? ["cause"] : [])];
    for (const group of table.tBodies) {
      const why = grouped ? [quoted(group.rows[0].querySelector("a").textContent)] : [];
      for (const row of [...group.rows].slice(why.length)) {
        const plain = [...row.cells].map((one, at) => grouped && at === row.cells.length - 1
          ? quoted([...one.querySelectorAll("code")].map((each) => each.textContent).join("; ")) : cell(one));
        lines.push(plain.concat(why));
      }
    }
    return lines.map((line) => line.join(",") + "\r\n").join("");
  }
  for (const table of document.querySelectorAll("main table")) {
    const button = make("button", { type: "button", class: "save", "aria-label": `Save as CSV: ${table.dataset.name}` }, "CSV");
    button.addEventListener("click", () => save(file(table.dataset.name, "csv"), "text/csv", csv(table)));
    table.parentElement.after(button);
  }
  function drawing(svg, note) {
    const copy = svg.cloneNode(true), mine = [svg, ...svg.querySelectorAll("*")];
    [copy, ...copy.querySelectorAll("*")].forEach((one, k) => {
      const style = getComputedStyle(mine[k]);
      for (const name of ["fill", "stroke", "color", "font-family"]) if (/var\(/.test(one.getAttribute("style") ?? "")) one.style[name] = style[name];
    });
    const said = document.createElementNS(svg.namespaceURI, "desc");
    said.append(note);
    copy.style.minWidth = "";
    copy.prepend(said);
    return new XMLSerializer().serializeToString(copy);
  }
  for (const chart of document.querySelectorAll(".chart, .still")) {
    const svg = chart.querySelector("svg"), title = chart.closest("figure")?.querySelector("h3")?.textContent ?? "figure";
    if (!svg) continue;
    const button = make("button", { type: "button", class: "save", "aria-label": `Save as SVG: ${title}` }, "SVG");
    button.addEventListener("click", () => save(file(title, "svg"), "image/svg+xml", drawing(svg,
      chart.querySelector("[aria-label]")?.getAttribute("aria-label") ?? chart.parentElement.querySelector('script[type="application/json"]')?.textContent ?? title)));
    chart.closest(".media, figure").append(button);
  }

  // paper has no folds
  addEventListener("beforeprint", () => { for (const fold of document.querySelectorAll("details:not(.cases details)")) fold.open = true; });
})();
