// The studio's page: views by the address behind #, answers of /api as JSON. All text from outside is set as text.
"use strict";

const $ = (selector) => document.querySelector(selector);
let listed = null; // what the folder holds
let here = newView(); // the view that is shown: what it shows, and what asks whether it may be left, and ends it

function newView() {
  return { main: el("div"), leave: () => true, unsaved: () => false };
}

/** Return an element with attributes, functions for events, and children; a text is a text. */
function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value);
    else if (typeof value === "boolean") made.toggleAttribute(name, value);
    else made.setAttribute(name, value);
  }
  made.append(...children.flat());
  return made;
}

/** Ask the server; throw an error with its message if it refuses. */
async function ask(method, name, parameters = {}, body = undefined) {
  let answer;
  try {
    answer = await fetch(`/api/${name}?${new URLSearchParams(parameters)}`, { method, body });
  } catch {
    throw new Error("The studio does not answer: has it been stopped?");
  }
  if ((answer.headers.get("content-type") || "").startsWith("application/json")) {
    const found = await answer.json();
    if (answer.ok) return found;
    throw new Error(found.error);
  }
  throw new Error(await answer.text());
}

function say(text, grade = "") {
  $("#status").className = grade;
  $("#status").textContent = text;
}

/** Do something that a button asks for; say what goes wrong. */
async function attempt(what, work) {
  say(`${what} …`);
  try {
    const done = await work();
    say(typeof done === "string" ? done : "");
  } catch (error) {
    say(error.message, "bad");
  }
}

const link = (view, ...parts) => `#/${[view, ...parts.map(encodeURIComponent)].join("/")}`;
const percent = (share) => `${(100 * share).toFixed(1)} %`;

function table(caption, heads, rows) {
  const numeric = (cell) => (typeof cell === "number" ? "number" : "");
  return el("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": caption }, el("table", {}, el("caption", {}, caption),
    el("thead", {}, el("tr", {}, heads.map((head) => el("th", { scope: "col" }, head)))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map((cell) =>
      el("td", { class: numeric(cell) }, cell instanceof Node ? cell : String(cell ?? ""))))))));
}

// ---- the list beside

async function refresh() {
  listed = await ask("GET", "files");
  $("#folder").textContent = listed.folder;
  const kinds = [["study", "Studies"], ["model", "Models"], ["data", "Data"], ["binding", "Bindings"], ["world", "Worlds"]];
  const known = kinds.map(([kind]) => kind);
  const groups = kinds.map(([kind, title]) => [title, listed.files.filter((one) => one.kind === kind)]);
  groups.push(["Other files", listed.files.filter((one) => !known.includes(one.kind))]);
  const nav = $("nav");
  nav.replaceChildren();
  for (const [title, files] of groups) {
    if (files.length) nav.append(el("h2", {}, title), el("ul", {}, files.map((one) => item(link("file", one.path), one.path))));
  }
  if (listed.runs.length) nav.append(el("h2", {}, "Runs"), el("ul", {}, listed.runs.map((one) => item(link("run", one.run), one.run))));
  if (!listed.all) nav.append(el("p", { class: "soft" }, "The folder holds more than is listed."));
  mark();
}

const item = (href, text) => el("li", {}, el("a", { href }, text));

function mark() {
  for (const one of document.querySelectorAll("nav a")) {
    if (one.getAttribute("href") === location.hash) one.setAttribute("aria-current", "page");
    else one.removeAttribute("aria-current");
  }
}

// ---- home: runs, and two of them compared

function home(view) {
  const { main } = view;
  main.replaceChildren(starting(view), el("h2", {}, "Runs in this folder"));
  if (!listed.runs.length) {
    main.append(el("p", {}, "There is no run yet. Open a study and run it, or write one here: parcours run STUDY --out out/mine"));
    return;
  }
  const rows = listed.runs.map((one) => [el("a", { href: link("run", one.run) }, one.run), one.study ?? "", one.seed ?? "", one.error ?? one.settings ?? ""]);
  main.append(table("Choose one to see its outcomes", ["run", "study", "seed", "settings"], rows));
  if (listed.runs.length < 2) return;
  const options = () => listed.runs.map((one) => el("option", {}, one.run));
  const before = el("select", { id: "before" }, options());
  const now = el("select", { id: "now" }, options());
  now.selectedIndex = listed.runs.length - 1;
  main.append(el("h3", {}, "Compare two runs"), el("div", { class: "bar" }, el("label", { for: "before" }, "before"), before,
    el("label", { for: "now" }, "now"), now, el("button", { click: () => { location.hash = link("compare", before.value, now.value); } }, "Compare")));
}

/** Starts studies that have no study.yaml here: registered ones, and those in Python. */
function starting(view) {
  const study = el("input", { id: "study", list: "studies", placeholder: "NAME or file.py:NAME", spellcheck: "false" });
  const settings = el("input", { id: "settings", placeholder: "parameter=value ...", spellcheck: "false" });
  const cases = el("input", { id: "number", type: "number", min: "1", placeholder: "all" });
  const run = () => attempt("Starting", async () => {
    const found = await ask("POST", "run", { path: study.value, settings: settings.value, cases: cases.value });
    if (study.value.includes(".py:")) trusted.add(found.run);
    if (here === view) location.hash = link("run", found.run);
  });
  return el("details", {}, el("summary", {}, "Run a registered study, or one in Python"), el("div", { class: "bar" },
    el("label", { for: "study" }, "study"), study, el("datalist", { id: "studies" }, listed.studies.map((name) => el("option", { value: name }))),
    el("label", { for: "settings" }, "settings"), settings, el("label", { for: "number" }, "cases"), cases, el("button", { click: run }, "Run")));
}

async function compare({ main }, before, now) {
  main.replaceChildren(el("h2", {}, `${now} against ${before}`));
  await attempt("Comparing", async () => {
    const found = await ask("POST", "compare", [before, now].every((run) => !trusted.has(run)) ? { before, now } : { before, now, code: "1" });
    if (!found.shared) {
      const heads = Object.keys(found.rows[0] ?? {});
      main.append(table("The runs share no cases: two separate samples", heads, found.rows.map((row) => heads.map((head) => row[head]))));
      return;
    }
    const rows = found.rows.map((row) => [row.name, Number(row.before.toPrecision(4)), Number(row.now.toPrecision(4)),
      row.low === null ? "" : el("span", { class: "range" }, `[${row.low.toPrecision(3)}, ${row.high.toPrecision(3)}]`),
      row.p_value === null ? "" : Number(row.p_value.toPrecision(3)), row.worse ? el("span", { class: "bad" }, "worse") : "",
      row.flipped.length ? el("details", {}, el("summary", {}, String(row.flipped.length)), row.flipped.join(", ")) : 0]);
    main.append(table(`On the ${found.shared} cases that both have`, ["measure", "before", "now", "difference, 95 %", "p", "", "cases that flipped"], rows));
  });
}

// ---- a file: its text, what is wrong with it, drawings beside it

async function file(view, path) {
  const kind = listed.files.find((one) => one.path === path)?.kind ?? "file";
  const opened = await ask("GET", "file", { path });
  let { version, text: saved } = opened;
  const area = el("textarea", { spellcheck: "false", autocapitalize: "off", "aria-label": `text of ${path}`, wrap: "off" });
  area.value = saved = saved.replaceAll("\r\n", "\n");
  const gutter = el("pre", { "aria-hidden": "true" });
  const findings = el("ul", { class: "findings", "aria-label": "findings" });
  const beside = el("div", {});
  const save = el("button", { click: () => attempt("Saving", store) }, "Save");
  let known = [], timer = 0, turn = 0;

  function number() {
    const grades = new Map(known.filter((one) => one.line).map((one) => [one.line, one.severity]));
    const count = area.value.split("\n").length;
    gutter.replaceChildren(...Array.from({ length: count }, (_, k) => el("span", { class: grades.get(k + 1) ?? "" }, `${k + 1}\n`)));
    gutter.scrollTop = area.scrollTop;
  }

  async function check() {
    const mine = ++turn;
    try {
      const found = await ask("POST", "check", { path }, area.value);
      if (mine !== turn) return;
      known = found.findings;
      const plural = known.length === 1 ? "" : "s";
      findings.replaceChildren(...(known.length ? known.map(finding) : [el("li", { class: "good" }, "no findings")]));
      findings.dataset.count = known.length;
      findings.setAttribute("aria-label", `${known.length} finding${plural}`);
      if (found.drawings.length) show(beside, found.drawings);
    } catch (error) {
      if (mine === turn) findings.replaceChildren(el("li", { class: "bad" }, error.message));
    }
    number();
  }

  const finding = (one) => el("li", {},
    one.file === path && one.line ? el("button", { click: () => go(one.line) }, `line ${one.line}`) : `${one.file}${one.line ? `:${one.line}` : ""}`,
    " ", el("span", { class: one.severity === "error" ? "error-word" : "" }, one.severity), `: ${one.message}${one.remedy ? `; ${one.remedy}` : ""} `, el("code", {}, `[${one.rule}]`));

  function go(line) {
    const start = area.value.split("\n").slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    const end = area.value.indexOf("\n", start);
    area.focus();
    area.setSelectionRange(start, end < 0 ? area.value.length : end);
    area.scrollTop = Math.max(0, (line - 6) * 20);
  }

  async function store() {
    const text = area.value;
    version = (await ask("PUT", "file", { path, version }, text)).version;
    saved = text;
    edited();
    return `saved ${path}`;
  }

  const edited = () => { save.disabled = area.value === saved; };
  area.addEventListener("input", () => { edited(); number(); clearTimeout(timer); timer = setTimeout(check, 150); });
  area.addEventListener("scroll", () => { gutter.scrollTop = area.scrollTop; });
  area.addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === "s") { event.preventDefault(); attempt("Saving", store); }
  });
  const unsaved = view.unsaved = () => area.value !== saved;
  view.leave = () => { clearTimeout(timer); turn++; return !unsaved() || confirm(`${path} is not saved. Leave it?`); };

  edited();
  number();
  const { main } = view;
  main.replaceChildren(el("h2", {}, path), el("div", { class: "bar" }, save, el("span", { class: "soft" }, "Ctrl-S")),
    el("div", { class: "sides" }, el("div", {}, el("div", { class: "editor" }, gutter, area), findings), beside));
  if (kind === "study") main.append(running(view, path));
  if (kind === "study" || kind === "model") main.append(generating(view, path));
  await check();
}

const ensured = (view) => { if (view.unsaved()) throw new Error("Save the file first: what lies on the disk is used."); };

function running(view, path) {
  const count = el("input", { type: "number", min: "1", id: "count", placeholder: "all" });
  const said = el("ul", { class: "findings" });
  const run = () => attempt("Starting", async () => {
    ensured(view);
    const found = await ask("POST", "run", { path, cases: count.value });
    if (here === view) location.hash = link("run", found.run);
  });
  const battery = () => attempt("Checking the study, which runs some of its cases", async () => {
    ensured(view);
    const found = await ask("POST", "study", { path });
    said.replaceChildren(...(found.findings.length ? found.findings.map((one) => el("li", {}, `${one.level}: ${one.where}: ${one.rule}${one.remedy ? `; ${one.remedy}` : ""}`)) : [el("li", { class: "good" }, "the study passes its check")]));
  });
  return el("section", { "aria-label": "run" }, el("h3", {}, "Run"), el("div", { class: "bar" }, el("label", { for: "count" }, "cases"), count,
    el("button", { click: run }, "Run"), el("button", { click: battery }, "Check the study")), said);
}

function generating(view, path) {
  const criterion = el("select", { id: "criterion" }, listed.criteria.map((name) => el("option", {}, name)));
  criterion.value = "edge";
  const into = el("div", {});
  const paths = () => attempt("Looking for paths", async () => {
    ensured(view);
    const found = await ask("POST", "paths", { path, criterion: criterion.value });
    const rows = Array.isArray(found)
      ? found.flatMap((one) => one.paths.map((each) => [one.component, each.name, each.transitions.join(" "), each.transitions.length]))
      : found.paths.map((moves, k) => ["all together", String(k + 1), moves.join(" "), moves.length]);
    into.replaceChildren(table(`${rows.length} paths, ${criterion.value} coverage`, ["component", "path", "transitions", "length"], rows));
  });
  const cases = () => attempt("Making abstract cases", async () => {
    ensured(view);
    const found = await ask("POST", "cases", { path });
    const rows = found.slice(0, 500).map((one) => [el("a", { href: link("step", path, one.id) }, one.id), one.interaction, one.combination]);
    into.replaceChildren(table(`${found.length} abstract cases; choose one to step through it`, ["case", "interaction", "paths"], rows));
  });
  return el("section", { "aria-label": "generate" }, el("h3", {}, "Generate"), el("div", { class: "bar" }, el("label", { for: "criterion" }, "criterion"), criterion,
    el("button", { click: paths }, "Paths"), el("button", { click: cases }, "Abstract cases")), into);
}

/** Put drawings into an element; they are parsed as pictures, which run nothing. */
function show(into, drawings) {
  into.replaceChildren(...drawings.map((one) => {
    const picture = new DOMParser().parseFromString(one.svg, "image/svg+xml").documentElement;
    const svg = document.importNode(picture, true), sized = [svg, ...svg.querySelectorAll("[font-size]")];
    const sizes = sized.map((each) => Number(each.getAttribute("font-size"))).filter(Boolean);
    // so wide that its smallest text has 11 px; it is scrolled where there is no room
    if (sizes.length) svg.style.minWidth = `${Math.ceil(11 * svg.viewBox.baseVal.width / Math.min(...sizes))}px`;
    return el("div", { class: "drawing", tabindex: "0", role: "group", "aria-label": one.title }, svg);
  }));
}

// ---- a case, step by step: the state that each machine is in, and the transition just taken

async function step(view, path, id) {
  const { main } = view;
  main.replaceChildren(el("h2", {}, id));
  await attempt("Executing the case", async () => {
    const found = await ask("POST", "step", { path, case: id });
    const events = found.events, machines = found.drawings;
    const pictures = el("div", {});
    const list = el("ol", { class: "events", tabindex: "0", "aria-label": "events of the case" }, events.map((one, k) => el("li", { click: () => to(k) }, spoken(one))));
    const slider = el("input", { type: "range", min: "0", max: String(Math.max(events.length - 1, 0)), value: "0", "aria-label": "event", input: () => to(Number(slider.value)) });
    const place = el("span", { class: "soft", "aria-live": "polite" });
    let at = 0, playing = 0;
    const play = el("button", { click: () => (playing ? stop() : start()) }, "Play");
    const start = () => { if (at === events.length - 1) to(0); play.textContent = "Pause"; playing = setInterval(() => (at < events.length - 1 ? to(at + 1) : stop()), 700); };
    const stop = () => { clearInterval(playing); playing = 0; play.textContent = "Play"; };

    function to(k) {
      at = Math.min(Math.max(k, 0), events.length - 1);
      const states = new Map(), last = new Map(); // state by instance and machine; the latest instance of a component
      for (const one of events.slice(0, at + 1)) {
        const component = one.component.split("#")[0];
        if (one.component) last.set(component, one.component);
        if (one.kind !== "take") continue;
        machines.forEach((machine, m) => {
          if (machine.component === component && Object.hasOwn(machine.transitions, one.transition)) states.set(`${one.component} ${m}`, machine.transitions[one.transition][1]);
        });
      }
      const now = events[at] ?? {};
      machines.forEach((machine, m) => light(pictures.children[m], states.get(`${last.get(machine.component)} ${m}`) ?? machine.initial,
        now.kind === "take" && now.component.split("#")[0] === machine.component ? now.transition : null));
      [...list.children].forEach((one, j) => { one.classList.toggle("lit", j === at); one.toggleAttribute("aria-current", j === at); });
      list.scrollTop = (list.children[at]?.offsetTop ?? 0) - list.offsetTop - 80;
      slider.value = String(at);
      place.textContent = events.length ? `${at + 1} of ${events.length}: ${spoken(now)}` : "nothing happened";
    }

    list.addEventListener("keydown", (event) => {
      const move = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1, Home: -events.length, End: events.length }[event.key];
      if (move) { event.preventDefault(); to(at + move); }
    });
    view.leave = () => { stop(); return true; };
    show(pictures, machines);
    const values = Object.entries(found.values).map(([name, value]) => `${name} = ${value}`).join(", ");
    main.append(el("p", {}, found.verdict ? el("span", { class: found.verdict === "pass" ? "good" : "bad" }, found.verdict) : "planned", `: ${found.why}`),
      ...(values ? [el("p", { class: "soft" }, values)] : []),
      el("div", { class: "bar" }, el("button", { click: () => to(0) }, "First"), el("button", { click: () => to(at - 1) }, "Back"), play,
        el("button", { click: () => to(at + 1) }, "Next"), el("button", { click: () => to(events.length - 1) }, "Last"), slider),
      el("p", {}, place), el("div", { class: "sides" }, list, pictures), el("p", {}, el("a", { href: link("file", path) }, `back to ${path}`)));
    to(0);
  });
}

const spoken = (one) => [one.kind, one.component, one.transition, one.channel && `on ${one.channel}`, one.text].filter(Boolean).join(" ");

/** Light the state and the transition of a drawing: names stand right behind the shape that they name. */
function light(drawing, state, transition) {
  for (const text of drawing.querySelectorAll("text[text-anchor=middle]")) {
    const shape = text.previousElementSibling;
    const name = text.querySelector("title")?.textContent ?? text.textContent;
    const lit = name === (shape?.tagName === "ellipse" ? state : transition);
    shape?.classList.toggle("lit", lit);
    text.classList.toggle("lit", lit);
  }
}

// ---- a run, while it goes on

const trusted = new Set(); // runs whose study is code of the folder that the user wants to be run

async function watch(view, run) {
  const body = el("div", {}), own = el("div", {});
  view.main.replaceChildren(el("h2", {}, run), own, body);
  const events = new EventSource(`/api/watch?${new URLSearchParams(trusted.has(run) ? { run, code: "1" } : { run })}`);
  let timer = 0;
  view.leave = () => { events.close(); clearTimeout(timer); return true; };
  events.onmessage = (event) => { const news = JSON.parse(event.data); body.replaceChildren(...outcomes(news)); body.dataset.finished = news.finished; say(""); };
  events.addEventListener("refused", (event) => { events.close(); const { error, slug } = JSON.parse(event.data); refuse(error); if (slug === "studio-code") body.append(trusting(run)); });
  events.onerror = () => { if (events.readyState === EventSource.CLOSED) refuse("There is nothing to watch there."); };
  const refuse = (why) => body.replaceChildren(el("p", { class: "bad" }, why));

  async function ownState() {
    let state = {};
    try { state = await ask("GET", "state", { run }); } catch (error) { say(error.message, "bad"); }
    own.replaceChildren();
    if (state.running) own.append(el("p", {}, "The run goes on. ", el("button", { click: () => attempt("Stopping", async () => { await ask("POST", "stop", { run }); await ownState(); }) }, "Stop")));
    else if (state.running === false) {
      own.append(el("p", {}, `The run ended with exit code ${state.exit}.`));
      if (state.exit > 1) own.append(el("pre", {}, state.words));
    }
    return state;
  }

  async function follow() {
    const { running } = await ownState();
    if (here !== view) return;
    if (running) timer = setTimeout(follow, 1000);
    else if (!listed.runs.some((one) => one.run === run)) await refresh();
  }
  await follow();
}

const trusting = (run) => el("button", { click: () => { trusted.add(run); route(); } }, "Run its code");

function outcomes(news) {
  const all = news.planned ? `${news.finished} of ${news.planned} cases` : `${news.finished} cases`;
  const rate = news.per_second ? `, ${news.per_second.toPrecision(3)} per second recently` : "";
  const changed = news.changed ? `; the last one at ${new Date(1000 * news.changed).toLocaleTimeString()}` : "";
  const grade = { pass: "good", fail: "bad", error: "bad" };
  const rows = news.verdicts.map((one) => [el("span", { class: grade[one.verdict] ?? "" }, one.verdict), one.cases, percent(one.share), `[${percent(one.low)}, ${percent(one.high)}]`]);
  const made = [el("p", {}, `${news.study}, ${news.label}: ${all}${rate}${changed}`)];
  if (news.planned) made.push(el("progress", { max: String(news.planned), value: String(news.finished), "aria-label": "finished cases" }));
  made.push(table("Outcomes so far; 95 % intervals that hold however often you look", ["verdict", "cases", "share", "interval"], rows));
  if (news.latest.length) made.push(table("Latest cases that did not pass", ["case", "verdict", "reason"], news.latest.map((one) => [el("code", {}, one.id), one.verdict, one.why])));
  made.push(el("p", { class: "soft" }, "One of them again, as a page: ", el("code", {}, `parcours replay ${news.run} CASE`)));
  return made;
}

// ---- which view

const views = { file, run: watch, compare, step };
let current = "";

async function route() {
  if (location.hash && !location.hash.startsWith("#/")) return; // the link to the content
  if (!here.leave()) { history.replaceState(null, "", current); return; }
  const view = here = newView(); // what a view that was left still waits for comes into its own element
  $("main").replaceChildren(view.main);
  current = location.hash || "#/";
  mark();
  say("");
  try {
    const [name, ...parts] = location.hash.slice(2).split("/").map(decodeURIComponent);
    document.title = `${parts.at(-1) ?? "Parcours studio"} – Parcours studio`;
    if (!name) { await refresh(); home(view); } else if (Object.hasOwn(views, name)) await views[name](view, ...parts);
    else throw new Error("There is no such view.");
  } catch (error) {
    view.main.replaceChildren(el("p", { class: "bad" }, error.message));
  }
}

if (location.search) history.replaceState(null, "", location.pathname + location.hash); // the token, out of sight
window.addEventListener("hashchange", route);
window.addEventListener("beforeunload", (event) => { if (here.unsaved()) event.preventDefault(); });
try {
  await refresh();
  await route();
} catch (error) {
  say(error.message, "bad");
}
