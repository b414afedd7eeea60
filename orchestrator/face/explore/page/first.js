"use strict";
// The first screen: the values that move the mode most, the response to the event, and questions that are clicks.
const MOVERS_WORK = "what moves it", WANTED_DAMPING = 10;

// What follows the modes: the response, then the values that move the least damped mode; both while the page is used.
async function firstScreen() {
  const key = JSON.stringify([theCase(), state.range]);
  if (seen.firstOf === key) return;
  seen.firstOf = key;
  paintQuestions();
  if (SAVED && seen.movers) {  // its sentences and its curve are those of the case's own values
    seen.moversStale = Object.keys(state.values).length > 0;
    paintMovers(); paintFirstPlot();
    return;
  }
  if (!SAVED && !seen.modes.length && state.range[1] < 1000) { setRange(0, 1000); return; }
  await firstResponse(key);
  if (key === seen.firstOf) await findMovers(key);
}
async function firstResponse(key) {
  $("first-plot").classList.add("stale");
  const said = make("p", { class: "soft" });
  const found = await ask("response", { ask: "first", ...theCase(), signals: [] }, said);
  if (found === undefined || key !== seen.firstOf) return;
  $("first-plot").classList.remove("stale");
  seen.firstCurves = found?.curves ?? {};
  seen.firstReason = found?.reason ?? said.textContent;
  paintFirstPlot();
}
function paintFirstPlot() {
  const name = Object.keys(seen.firstCurves ?? {})[0], moved = SAVED && Object.keys(state.values).some(one => state.values[one] !== (SAVED.beginning.values[one] ?? original(one)));
  $("first-event").textContent = !seen.info ? "" : `${eventsNow().map(wordsOf).join("; ") || "the scenario has no event"}${moved ? " (at the case's own values)" : ""}`;
  if (name) { $("first-plot").replaceChildren(chartOf(name, [{ data: seen.firstCurves[name], look: " linear", text: "linear model", colour: "#d55e00" }], span, paintFirstPlot)); return; }
  const run = make("button", {}, "Run the co-simulation");
  run.addEventListener("click", () => { openTab("response"); coSimulation(); });
  $("first-plot").replaceChildren(make("p", { class: "soft" }, seen.firstReason ? `${reasonOf(seen.firstReason)} ` : "The response is being computed … ", SAVED || !seen.firstReason ? null : run));
}

// -- the values that move the mode most -----------------------------------------------------------------------------

async function findMovers(key) {
  const least = leastOf(seen.modes), known = seen.moversOf === state.scenario ? (seen.movers?.movers ?? []).map(one => one.parameter) : [];
  if (!least) { seen.movers = null; seen.moversReason = "No oscillation is in the range."; paintMovers(); return; }
  seen.moversStale = true;
  paintMovers();
  const said = make("span"), found = await ask(MOVERS_WORK, { ask: "movers", ...theCase(), range: state.range, components: least.components, names: known }, said);
  if (found === undefined || key !== seen.firstOf) return;
  seen.moversReason = found?.reason ?? said.textContent;
  if (found?.movers) {
    found.gains = { ...(known.length ? seen.movers.gains : {}), ...found.gains };  // anew, only the sliders' values are looked at
    Object.assign(seen, { movers: found, moversOf: state.scenario, moversAgain: known.length > 0 });
  }
  seen.moversStale = false;
  paintMovers();
  paintQuestions();
}
const signed = (x, digits) => `${x < 0 ? "−" : "+"}${+Math.abs(x).toPrecision(digits)}`;
// A round step, and what it does to first order.
function effectOf(one) {
  const unit = one.unit === "1" ? "" : ` ${one.unit}`;
  return `${signed(one.step, 3)}${unit} → ${signed(one.points, 2)} points of damping, ${signed(one.hertz, 2)} Hz${anotherWithin(one)}${one.doubts.length ? ` (doubtful: ${one.doubts[0]})` : ""}`;
}
// Which other mode is the least damped one where a saved page's slider has made its step, if one is.
function anotherWithin({ parameter, value, step }) {
  const end = value + step, grid = SAVED?.grid[parameter];
  if (!grid) return "";
  const modesAt = x => answerWith(parameter, x)?.modes.scenarios[0].modes ?? [], own = modesAt(ownOf(parameter)), first = leastOf(own);
  const said = (least, before, about) => (least && before && least !== before ? `; then another mode is damped least: ${about}${fixed(least.damping_percent, 2)} % at ${fixed(least.frequency_hz, 3)} Hz` : "");
  const sameIn = modes => modes[partnersIn(modes, own).indexOf(first)];  // the mode that is shown, where it is recognised
  if (grid.includes(end)) return said(leastOf(modesAt(end)), sameIn(modesAt(end)), "");
  const cell = cellAround({ [parameter]: end });
  if (!cell) return "";
  const corner = SAVED.answers[cell.corners[0]].answer.modes.scenarios[0].modes, shown = corner.indexOf(sameIn(corner));
  const between = betweenOf(cell, { [parameter]: end }).map(m => ({ damping_percent: m.damping, frequency_hz: m.hz }));
  return said(leastOf(between), between[cell.modes.findIndex(one => one[0] === shown)], "≈ ");
}
// By which rule the sliders were chosen, and of how many values.
const wordsOfChoice = ({ looked_at, of }) => `By ∂λ/∂p of the running FMUs: the values that move frequency and damping furthest for the same percentage, first the one whose step moves damping most${looked_at < of && !seen.moversAgain ? `; ${looked_at} of ${of} values were looked at` : ""}.`;
// The sliders are made `anew` where values were set; else only their sentences change, so that none is lost in a drag.
function paintMovers(anew = false) {
  const known = seen.moversOf === state.scenario ? seen.movers : null, of = known && `${fixed(known.frequency_hz, 3)} Hz, ${fixed(known.damping_percent, 2)} %`;
  $("movers-title").textContent = known ? `${seen.moversAgain ? "How these move it" : "What moves it most"}: ${of}` : "What moves it most";
  $("movers").classList.toggle("stale-words", Boolean(seen.moversStale));
  const shown = (known?.movers ?? []).filter(one => !state.controls.includes(one.parameter));
  const there = Object.fromEntries([...$("movers").querySelectorAll(".control")].map(box => [box.dataset.name, box]));
  const again = make("button", {}, "look for others"), parts = shown.map(one => {
    const box = anew ? null : there[one.parameter];
    if (!box) return controlOf(one.parameter, one);
    box.querySelector(".effect").textContent = effectOf(one);
    return box;
  });
  again.addEventListener("click", () => { seen.movers = null; seen.firstOf = ""; firstScreen(); });
  if (SAVED && !SAVED.movers) { $("movers-title").hidden = true; return; }
  if (!known) parts.push(make("p", { class: "soft" }, seen.moversReason || "The FMUs are being asked which values move this mode most …"));
  else if (!known.movers.length) parts.push(make("p", { class: "soft" }, seen.moversReason || `None of ${known.looked_at} values moves this mode.`));
  else parts.push(make("p", { class: "soft" }, `${SAVED ? "Each slider moves alone, over values that were computed. " : ""}${wordsOfChoice(known)} `, seen.moversAgain && !SAVED ? again : null));
  const boxes = parts.slice(0, shown.length);
  if (boxes.some((box, k) => $("movers").children[k] !== box) || $("movers").children.length !== parts.length) { $("movers").replaceChildren(...parts); return; }
  $("movers").lastElementChild.replaceWith(parts.at(-1));
}
// In a saved page without a grid, a slider moves alone: the others go back to the case's values.
function keepOneMoved(snapped) {
  const away = Object.keys(snapped).filter(name => name !== seen.moved && snapped[name] !== (SAVED.beginning.values[name] ?? original(name) ?? snapped[name]));
  for (const name of away) {
    delete state.values[name];
    document.querySelector(`.control[data-name="${CSS.escape(name)}"]`)?.replaceWith(controlOf(name, seen.movers?.movers.find(one => one.parameter === name)));
  }
  for (const name of Object.keys(snapped)) if (name !== seen.moved || snapped[name] === (SAVED.beginning.values[name] ?? original(name))) delete snapped[name];
}

// -- questions ------------------------------------------------------------------------------------------------------

// A line without which the network hangs together: the one that was clicked, else that with the largest flow.
function lineToLose() {
  const d = seen.info?.diagram, flows = Object.fromEntries((flowOf()?.branches ?? []).map(b => [b.name, Math.abs(b.p_from_mw)]));
  if (!d) return null;
  const beside = {}, add = (from, to, line) => (beside[from] ??= []).push([to, line]);
  for (const l of d.lines) if (isOn(l.open)) { add(l.from, l.to, l); add(l.to, l.from, l); }
  const whole = lost => {
    const reached = new Set([d.buses[0].name]), todo = [d.buses[0].name];
    while (todo.length) for (const [to, line] of beside[todo.pop()] ?? []) if (line !== lost && !reached.has(to)) { reached.add(to); todo.push(to); }
    return reached.size === d.buses.length;
  };
  const clicked = l => element?.kind === "line" && element.name === l.name;
  const closed = d.lines.filter(l => l.open && isOn(l.open)).sort((a, b) => clicked(b) - clicked(a) || (flows[b.name] ?? 0) - (flows[a.name] ?? 0));
  return closed.slice(0, 40).find(whole) ?? null;
}
const swingOf = answer => { const one = answer.modes.scenarios[0], least = leastOf(one.modes); return `${one.stable === true ? "stable" : one.stable === false ? "UNSTABLE" : "not known"}${least ? `, least damped ${fixed(least.frequency_hz, 3)} Hz with ${fixed(least.damping_percent, 2)} %` : ""}`; };
function sayElse(...parts) { $("else-said").replaceChildren(make("p", {}, ...parts)); }
async function withValues(values, words) {
  sayElse(`${words}: being computed …`);
  const error = make("span"), found = await ask("what if", { ask: "modes", ...theCase(), values: { ...state.values, ...values }, range: state.range }, error);
  if (found === undefined) return;
  if (!found) { sayElse(`${words}: ${reasonOf(error.textContent)}`); return; }
  const set = make("button", {}, "show it");
  set.addEventListener("click", () => setOnes(values, $("failure")));
  sayElse(`${words}: ${swingOf(found)}. Now: ${swingOf(seen.answer)}. `, set);
}
async function searchWith(name, percent) {
  if (!document.querySelector(`.control[data-name="${CSS.escape(name)}"]`)) addControl(name);
  seen.unfolded = name;
  const box = document.querySelector(`.control[data-name="${CSS.escape(name)}"]`), one = seen.finders[`${state.scenario} ${name}`];
  box.querySelector("details")?.setAttribute("open", "");
  box.scrollIntoView({ block: "nearest" });
  sayElse(`${name} is tried ${percent === null ? "until the system is unstable" : `until the least damped mode has ${percent} %`} …`);
  const show = await one.search(percent, false, words => sayElse(`${name}: ${words}`)), button = make("button", {}, "show it");
  button.addEventListener("click", () => show());
  const now = leastOf(seen.modes), here = now && percent !== null ? `now ${fixed(now.damping_percent, 2)} % at ${number(state.values[name] ?? original(name))}; ` : "";
  sayElse(`${name}: ${here}${one.said.innerText.replaceAll("\nalso ", "; also ").replaceAll(" set", "").split("\n")[0]} `, show ? button : "");
}
// What two scenarios of the case set otherwise: components that one of them removes, files of parameters, and values.
function differencesOf(one, other) {
  const [a, b] = [one, other].map(name => JSON.parse(seen.systems[name])), without = (list, those) => list.filter(entry => !those.includes(entry));
  const listed = ["remove", "parameters"].flatMap(kind => [...without(a[kind], b[kind]), ...without(b[kind], a[kind])]);
  return [...listed, ...Object.keys({ ...a.set, ...b.set }).filter(name => a.set[name] !== b.set[name])];
}
// The scenario that has no converter where this one has one, or has one where this one has none, and differs least in the rest.
function converterApart() {
  if (!seen.systems?.[state.scenario]) return undefined;
  const converters = name => { const one = JSON.parse(seen.systems[name]); return String([...one.remove, "and", ...Object.keys(one.set).filter(key => key.startsWith("units.alpha."))]); };
  const apart = Object.keys(seen.titles).filter(name => converters(name) !== converters(state.scenario)), count = name => differencesOf(name, state.scenario).length;
  return apart.sort((a, b) => count(a) - count(b))[0];
}
async function withoutConverter(other) {
  sayElse(`${seen.titles[other]}: being computed …`);
  const error = make("span"), found = await ask("comparison", { ask: "modes", ...theCase(), scenario: other, values: {}, events: null, range: state.range }, error);
  if (found === undefined) return;
  sayElse(found ? `${seen.titles[other]}: ${swingOf(found)}. ${titleNow()}: ${swingOf(seen.answer)}. They differ by ${differencesOf(other, state.scenario).join(", ")}.` : `${seen.titles[other]}: ${reasonOf(error.textContent)}`);
}
function whatAModeIs() {
  const m = seen.modes[chosenIndex()] ?? leastOf(seen.modes), z = m ? m.damping_percent / 100 : 0, left = Math.exp(-2 * Math.PI * z / Math.sqrt(Math.max(1e-9, 1 - z * z)));
  const own = m ? ` This one swings ${number(m.frequency_hz, 3)} times a second; ${left < 1 ? `after each swing ${number(100 * left, 2)} % of it is left` : `each swing is ${number(left, 3)} times the last`}, which is a damping of ${fixed(m.damping_percent, 2)} %. Most of it is in ${Object.keys(m.components).slice(0, 2).join(" and ")}.` : "";
  sayElse(`A mode is one of the ways in which the system swings by itself after any disturbance, as a bell has its tones: it has a frequency, a damping, and a shape, which tells who swings against whom (the arrows).${own}`);
}
// The gain that moves the shown mode most, and what is said of it where none moves it; of those that were not looked at
// the one whose device takes part most.
const A_ROUNDING = 0.005;  // points of damping, which no figure of the page shows
function gainToAsk() {
  const all = (seen.info?.parameters ?? []).filter(p => /(^|\.)K$/.test(p.parameter) && p.variability === "tunable" && p.value);
  const moves = (seen.moversOf === state.scenario ? seen.movers?.gains : null) ?? {}, shares = leastOf(seen.modes)?.components ?? {};
  const acts = p => p.switches.every(one => (state.values[one] ?? original(one)) !== false), share = p => shares[p.parameter.split(".")[0]] ?? 0;
  const gain = all.sort((a, b) => acts(b) - acts(a) || (moves[b.parameter] ?? 0) - (moves[a.parameter] ?? 0) || share(b) - share(a))[0];
  const none = gain && acts(gain) && moves[gain.parameter] < A_ROUNDING;
  return { gain, none: none ? " (none that was looked at moves this mode by more than a rounding)" : "" };
}
function paintQuestions() {
  const movers = seen.moversOf === state.scenario ? seen.movers?.movers ?? [] : [], first = (movers.find(one => one.parameter.startsWith("grid.")) ?? movers[0])?.parameter, { gain, none } = gainToAsk();
  const line = SAVED ? null : lineToLose(), long = seen.info?.diagram?.lines.find(l => l.length && original(l.length));
  const other = converterApart(), off = gain?.switches[0], questions = [];
  const add = (text, act) => { const button = make("button", {}, text); button.addEventListener("click", act); questions.push(button, " "); };
  if (!SAVED && line) add(`What if line ${line.name} is out?`, () => withValues({ [line.open]: false }, `Without line ${line.name}`));
  else if (!SAVED && long) add(`What if line ${long.name} were twice as long?`, () => withValues(Object.fromEntries([long.length, long.resistance, long.charging].filter(n => n && parameterOf(n) && original(n)).map(n => [n, 2 * (state.values[n] ?? original(n))])), `Line ${long.name}, twice as long`));
  if (!SAVED && first) add(`Up to which ${first} is it stable?`, () => searchWith(first, null));
  if (!SAVED && (gain || first)) add(`Which ${gain ? `gain ${gain.parameter}` : first} gives ${WANTED_DAMPING} %?`, () => searchWith(gain?.parameter ?? first, WANTED_DAMPING));
  if (!SAVED && other) add("What does the converter do?", () => withoutConverter(other));
  else if (!SAVED && off) {
    const on = (state.values[off] ?? original(off)) !== false;
    add(`What does ${off.replace(/\.enabled$/, "")} do?${none}`, () => withValues({ [off]: !on }, `${off} = ${!on}`));
  }
  for (const one of SAVED ? askedBefore() : []) add(one.question, () => sayAskedBefore(one));
  if (SAVED && gain && SAVED.grid[gain.parameter]) add(`Which gain ${gain.parameter} gives ${WANTED_DAMPING} %?`, () => askGain(gain.parameter));
  if (SAVED?.others) add("Which scenario damps most?", askBestScenario);
  const sliders = Object.keys(SAVED?.grid ?? {}), doubled = sliders.filter(isDoubled), twice = doubled.find(name => name.endsWith(".K")) ?? doubled[0];
  if (twice) add(`What if ${twice} is doubled?`, () => askDoubled(twice));
  for (const name of sliders.slice(0, 3)) add(`Which ${name} damps most?`, () => askBest(name));
  add("What is a mode?", whatAModeIs);
  $("questions").replaceChildren(...questions);
}
function beginFirst() {
  $("all-signals").addEventListener("click", () => {
    openTab("response");
    if (!Object.keys(seen.curves).length && seen.firstCurves) takeCurves("linear", Object.entries(seen.firstCurves));
  });
  paintFirstPlot(); paintMovers();
}
