"use strict";
// What happens when: the page is opened, a value is set, a button pressed.
const TABS = ["map", "network", "response", "study"];

let computeTurn = 0;  // of the last state that was asked for
// The exact modes of the state, and whether they are there; `place` is where a refusal is said.
async function compute(place = null) {
  const begin = performance.now(), asked = copyOf({ ask: "modes", ...theCase(), range: state.range });
  failed("");
  document.querySelectorAll(".control .error").forEach(one => { one.textContent = ""; });
  const turn = computeTurn += 1;
  let found = await ask("modes", asked, place);
  while (found === undefined && turn === computeTurn) found = await ask("modes", asked, place);  // a question overtook it
  if (found === undefined) return false;
  if (found === null) {  // figures, controls, the address and the copies stay those of the values before
    const name = place?.closest(".control")?.dataset.name, why = place?.textContent;
    if (seen.computed) { Object.assign(state, copyOf(seen.computed)); $("scenario").value = state.scenario; keepState(); }
    seen.estimate = null;
    if (seen.answer) { paintVerdict(); paintMap(); paintTable(); paintControls(); }
    const error = name && document.querySelector(`.control[data-name="${CSS.escape(name)}"] .error`);
    if (error) error.textContent = why; else if (place && why) failed(`not computed; what is shown is the state before${place.closest("#element") ? "" : `: ${reasonOf(why)}`}`);
    return false;
  }
  seen.computed = { scenario: asked.scenario, values: asked.values, events: asked.events, range: asked.range };
  const before = seen.modes, after = found.modes.scenarios[0].modes;
  const partners = partnersIn(after, before);
  const trails = after.map((m, k) => {
    const old = seen.answer && seen.trailOf === state.scenario && partners[k] ? seen.trails[before.indexOf(partners[k])] ?? [] : [];
    return [...old.slice(-30), { real: m.real, hz: m.frequency_hz }];
  });
  const first = !seen.answer || seen.trailOf !== state.scenario || !same(seen.fittedRange, state.range);
  Object.assign(seen, { answer: found, modes: after, trails, trailOf: state.scenario, fittedRange: state.range, estimate: null });
  if (first) state.mode ??= nameOrPlace(leastOf(after));
  if (first || (inView(leastOf(before)) && !inView(leastOf(after)))) fitMap();
  paintVerdict();
  paintMap(); paintTable(); paintChosen(); paintNetwork();
  if (state.tab === "network") paintElement();
  keepState();
  painted(begin, "exact");
  if (seen.infoOf !== state.scenario) await loadInfo();
  firstScreen();
  return true;
}
const leastOf = modes => [...modes].sort((a, b) => a.damping_percent - b.damping_percent)[0];
// The scenario, and what was changed in it.
function titleNow() {
  const changed = Object.entries(state.values).map(([name, value]) => `${name} = ${number(value)}`);
  return `${seen.answer.title}${changed.length ? `, with ${changed.slice(0, 3).join(", ")}${changed.length > 3 ? ` and ${changed.length - 3} more` : ""}` : ""}`;
}
// At the rated frequency, with which the network's frame turns, its direct currents die away.
const isOfDirectCurrents = m => { const rated = seen.answer.rated_hz; return Boolean(rated) && m.damping_percent >= 0 && Math.abs(m.frequency_hz - rated) <= 0.02 * rated; };
function paintVerdict() {
  const one = seen.answer.modes.scenarios[0];
  $("verdict").className = one.stable === true ? "good" : one.stable === false ? "bad" : "";
  const least = leastOf(seen.modes), [low, high] = state.range;
  const swing = least ? `least damped from ${number(low)} to ${number(high)} Hz: ${fixed(least.frequency_hz, 3)} Hz, ${fixed(least.damping_percent, 2)} % (${swingers(seen.modes.indexOf(least)) || Object.keys(least.components).slice(0, 2).join(", ")}${isOfDirectCurrents(least) ? "; direct currents of the network, no swing of machines" : ""})` : `no oscillation from ${number(low)} to ${number(high)} Hz`;
  $("verdict").textContent = `${titleNow()}: ${one.stable === true ? "stable" : one.stable === false ? "UNSTABLE" : "not known"} (small-signal)${one.stable === false && !(least?.damping_percent < 0) ? ", by what grows besides (below)" : ""}; ${swing}`;
  paintOutside();
  $("wider").hidden = Boolean(SAVED) || !seen.answer.outside || state.range[1] >= 1000;
}
// The whole spectrum's verdict; `at` says of which state it is, where the headline is of another.
function paintOutside(at = "") {
  const { verdict, outside } = seen.answer, warnings = seen.answer.warnings ?? seen.answer.modes.scenarios[0].warnings;
  $("outside").querySelector("span").textContent = [`${at}${verdict}.`, outside && `${outside}.`, ...warnings.map(text => `Warning: ${text}`)].filter(Boolean).join(" ");
}
async function loadInfo() {
  const asked = state.scenario, empty = await ask("parameters", { ask: "parameters", scenario: asked, values: {} });
  if (!empty || asked !== state.scenario) return;
  seen.info = empty;
  seen.originals = Object.fromEntries(empty.parameters.map(p => [p.parameter, p.value]));
  seen.infoOf = asked;
  lens.w = 0;
  $("tab-network").hidden = !empty.diagram;
  if (state.tab === "network" && !empty.diagram) openTab("map");
  paintControls(); paintFound(); paintSignals(); paintNetwork(); paintElement();
}
async function pin() {
  if (state.pin) { state.pin = null; seen.pinned = null; seen.pinnedCurves = {}; }
  else { state.pin = copyOf({ ...theCase(), range: state.range }); seen.pinned = seen.answer; seen.pinnedCurves = copyOf(seen.curves); }
  paintPin();
  keepState();
  paintMap(); paintTable(); paintPlots();
}
function paintPin() {
  $("pin").setAttribute("aria-pressed", String(Boolean(state.pin)));
  $("pin").textContent = state.pin ? "Unpin A" : "Pin as A";
  $("pin").title = state.pin ? `A: ${state.pin.scenario}${Object.entries(state.pin.values).map(([n, v]) => `, ${n} = ${v}`).join("")}` : "Keep this state; the next ones are drawn against it";
}
function showCopies() {
  const names = { command: "As a command", toml: "As a scenario: put it at the end of the case file", python: "As Python" };
  $("dialog").querySelector("div").replaceChildren(...Object.entries(seen.answer?.copied ?? {}).flatMap(([kind, text]) => {
    const copy = make("button", {}, "Copy");
    copy.addEventListener("click", async () => { await navigator.clipboard.writeText(text); copy.textContent = "Copied"; });
    return [make("h3", {}, names[kind] ?? kind), make("pre", { "data-kind": kind }, text), copy];
  }));
  const save = make("button", {}, "Save as scenario"), said = make("p", { role: "status" });
  save.addEventListener("click", async () => {
    const found = await ask("saving", { ask: "save", ...theCase() }, said);
    if (found) said.textContent = `Written: ${found.file}, a copy of the case with the scenario 'explored'.`;
  });
  if (!SAVED) $("dialog").querySelector("div").append(make("div", {}, save), said);
  $("dialog").showModal();
}
function openTab(name) {
  state.tab = name;
  for (const one of TABS) {
    $(`panel-${one}`).hidden = one !== name;
    $(`tab-${one}`).setAttribute("aria-selected", String(one === name));
    $(`tab-${one}`).tabIndex = one === name ? 0 : -1;
  }
  $("trails-label").hidden = name !== "map";
  $("first-response").hidden = name === "response" || name === "study";
  for (const id of ["fit", "in", "out"]) $(id).hidden = name === "response" || name === "study";
  keepState();
  if (name === "network") { paintNetwork(); paintElement(); }
  if (name === "response") paintPlots();
  if (name === "study") paintCells();
  if (name === "map" && seen.modes.length) paintMap();
}
function setRange(low, high) {
  if (!(low >= 0 && high > low && high < 1e6)) { failed(`range ${low} to ${high} Hz: give two frequencies, the first of at least 0 and below the second`); return; }
  state.range = [low, high];
  $("low").value = low; $("high").value = high;
  compute();
}
function listen() {
  const source = new EventSource(`events?page=${PAGE_ID}`);
  source.onmessage = event => {
    const told = JSON.parse(event.data);
    if (told.part) streamed(told.part);
    if (told.progress) seen.timing[`said ${{ movers: MOVERS_WORK }[told.of] ?? "∂λ/∂p"}`] = told.progress;
  };
}
async function begin() {
  beginMap(); beginNetwork(); beginResponse(); beginFirst();
  seen.beginning = SAVED ? SAVED.beginning : await (await fetch("beginning")).json();
  readState(seen.beginning);
  if (!SAVED) listen(); else if (!SAVED.movers) for (const name of Object.keys(SAVED.grid)) if (!state.controls.includes(name)) state.controls.push(name);
  $("low").value = state.range[0]; $("high").value = state.range[1];
  for (const id of ["low", "high"]) { $(id).disabled = Boolean(SAVED); $(id).addEventListener("change", () => setRange(+$("low").value, +$("high").value)); }
  $("wider").addEventListener("click", () => setRange(0, 1000));
  $("search").addEventListener("input", paintFound);
  $("pin").addEventListener("click", pin);
  $("copy").addEventListener("click", showCopies);
  $("dialog").querySelector("p button").addEventListener("click", () => $("dialog").close());
  $("cancel").addEventListener("click", () => { seen.cancels += 1; ask("cancel", { ask: "cancel" }); atWork.clear(); working("cancel", false); });
  const picture = () => (state.tab === "network" ? $("network") : state.tab === "response" ? $("plots").querySelector("svg") ?? $("map") : $("map"));
  $("svg").addEventListener("click", () => download("explore.svg", "image/svg+xml", pictureOf(picture())));
  $("png").addEventListener("click", () => asPng(picture(), "explore.png"));
  $("csv").addEventListener("click", () => download("modes.csv", "text/csv", asCsv([["real [1/s]", "imag [rad/s]", "frequency [Hz]", "damping [%]", "name"], ...seen.modes.map(m => [m.real, m.imag, m.frequency_hz, m.damping_percent, m.name])])));
  for (const name of TABS) {
    $(`tab-${name}`).addEventListener("click", () => openTab(name));
    $(`tab-${name}`).addEventListener("keydown", event => {
      const names = TABS.filter(one => !$(`tab-${one}`).hidden), step = { ArrowRight: 1, ArrowLeft: names.length - 1 }[event.key];
      if (step) { openTab(names[(names.indexOf(state.tab) + step) % names.length]); $(`tab-${state.tab}`).focus(); }
    });
  }
  beginStudy();
  if (seen.beginning.recorded && !SAVED && !location.hash) state.tab = "response";
  openTab(TABS.includes(state.tab) && !$(`tab-${state.tab}`).hidden ? state.tab : "network");
  paintControls(); paintChosen(); paintPlots(); paintPin();
  if (SAVED) { $("between").textContent = wordsOfError(); $("another").textContent = "Look up a value of the case"; }
  const opened = await ask("case", { ask: "open" });
  if (!opened) { $("verdict").textContent = ""; return; }
  seen.titles = opened.scenarios;
  seen.systems = opened.systems;
  if (SAVED) $("between").append(wordsOfOthers(opened));
  $("title").textContent = $("title").title = opened.title;
  document.title = `${opened.case}: gfor explore`;
  if (!(state.scenario in opened.scenarios)) state.scenario = seen.beginning.scenario;
  $("scenario").replaceChildren(...Object.entries(opened.scenarios).map(([name, title]) => make("option", { value: name }, `${name}: ${title}`)));
  $("scenario").value = state.scenario;
  $("scenario").addEventListener("change", () => { state.scenario = $("scenario").value; state.events = null; seen.slopes = {}; compute(); });
  if (state.pin) {
    const was = await ask("A", { ask: "modes", ...state.pin });
    seen.pinned = was; paintPin();
  }
  await compute();
  if (seen.beginning.recorded && !SAVED) await recordedSignals();
}
begin();
