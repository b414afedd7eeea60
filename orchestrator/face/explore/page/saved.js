"use strict";
// A saved page: its answers were computed before; what lies between two of them is interpolated, and marked as such.
const heldNear = (name, wanted) => SAVED.grid[name].reduce((best, v) => (Math.abs(v - wanted) < Math.abs(best - wanted) ? v : best));
const ownOf = name => SAVED.beginning.values[name] ?? SAVED.own[name] ?? original(name) ?? SAVED.grid[name][0];

// The answer that lies nearest in the grid; the state takes its values. Null where a value is asked for that has none.
function savedAnswer(question) {
  if (question.ask === "open") return SAVED.open;
  if (question.ask === "parameters") return SAVED.parameters[question.scenario];
  if (question.ask === "movers") return SAVED.movers ?? { reason: "This page has the sliders above." };
  if (question.ask === "first") return SAVED.first;
  if (question.ask !== "modes") return null;
  const others = Object.keys(question.values).filter(name => !(name in SAVED.grid) && question.values[name] !== SAVED.beginning.values[name]);
  if (others.length) { failed(`${others[0]} was not computed for this page; gfor explore opens the case live`); return null; }
  const snapped = {};
  for (const name of Object.keys(SAVED.grid)) {
    snapped[name] = heldNear(name, question.values[name] ?? ownOf(name));
    if (name in state.values) state.values[name] = snapped[name];
  }
  if (SAVED.movers) keepOneMoved(snapped);
  return SAVED.answers.find(one => one.scenario === question.scenario && Object.entries(snapped).every(([n, v]) => one.values[n] === v))?.answer ?? null;
}
// While a slider is dragged: the nearest computed state, and over it what lies between.
async function dragSaved(name, value) {
  const begin = performance.now(), others = SAVED.movers ? [] : Object.keys(SAVED.grid).filter(one => one !== name);
  document.querySelectorAll(".snapped").forEach(one => one.remove());  // it told of the last release
  const wanted = { [name]: value, ...Object.fromEntries(others.map(one => [one, state.values[one] ?? ownOf(one)])) };
  Object.assign(seen, { moved: name, dragged: value });
  const near = JSON.stringify([name, heldNear(name, value), others.map(one => wanted[one])]);
  if (near !== seen.near) {  // else what is drawn is that state already
    state.values[name] = value;
    await compute();
    seen.near = near;
    if (seen.dragged !== value) return;  // the slider went on
  }
  const cell = cellAround(wanted);
  if (!cell || value === heldNear(name, value)) {
    if (seen.estimate) { seen.estimate = null; paintMap(); paintTable(); }
    paintVerdict();
    if (value !== heldNear(name, value)) $("verdict").textContent = `nearest computed value to ${number(value)}: ${$("verdict").textContent}`;
    return;
  }
  const between = betweenOf(cell, wanted), corner = cell.corners.findIndex(place => SAVED.answers[place].answer === seen.answer);
  seen.estimate = { name, value, modes: seen.modes.map((_, k) => between[cell.modes.findIndex(one => one[corner] === k)] ?? null) };
  paintMap(); paintTable();
  const least = [...between].sort((a, b) => a.damping - b.damping)[0];
  $("verdict").className = "estimated";
  const most = `any drawn mode by at most ${number(cell.most, 2)}${cell.least > cell.most ? "; a mode that is not drawn is damped least there" : ""}`;
  const off = `${number(cell.least, 2)} points${cell.hertz === undefined ? "" : ` and ${fixed(cell.hertz, 4)} Hz`}`;
  paintOutside(`Computed nearby, with ${name} = ${number(heldNear(name, value))}: `);
  $("verdict").textContent = estimated(name, value, least, 2, `between computed values, halfway off by ${off}, ${most}`);
  painted(begin, "estimate");
}
// The followed modes of a cell, on straight lines between its corners.
function betweenOf(cell, wanted) {
  const parts = Object.entries(cell.at).map(([key, [low, high]]) => (wanted[key] - low) / (high - low));
  const weights = cell.corners.map((_, c) => parts.reduce((all, part, k) => all * ((c >> (parts.length - 1 - k)) & 1 ? part : 1 - part), 1));
  return cell.modes.map(places => {
    const sum = key => places.reduce((all, k, c) => all + weights[c] * SAVED.answers[cell.corners[c]].answer.modes.scenarios[0].modes[k][key], 0);
    const real = sum("real"), imag = sum("imag");
    return { real, imag, hz: imag / 2 / Math.PI, damping: -100 * real / Math.hypot(real, imag) };
  });
}
// On release, and where a number is typed: the nearest value that was computed.
async function setSaved(name, value) {
  const near = typeof value === "number" && name in SAVED.grid ? heldNear(name, value) : null;
  if (near !== null) { seen.moved = name; if (near === ownOf(name)) delete state.values[name]; else state.values[name] = near; }
  Object.assign(seen, { estimate: null, near: null });
  const shown = await compute();
  keepState();
  paintControls();
  const error = document.querySelector(`.control[data-name="${CSS.escape(name)}"] .error`);
  if (error && near === null) error.textContent = "give a number";
  else if (error && shown && number(near) !== number(value)) error.before(make("span", { class: "snapped", role: "status" }, `nearest computed: ${number(near)} (${number(value)} was asked)`));
}
// How far what is drawn between computed values may be off: at values halfway, which were computed to know it.
function wordsOfError() {
  if (!SAVED.cells.length) return "";
  const sorted = key => SAVED.cells.map(one => one[key]).sort((a, b) => a - b), least = sorted("least"), most = sorted("most"), last = most.length - 1;
  const hidden = SAVED.cells.filter(one => one.least > one.most).length;
  return `While you drag, ≈ is interpolated: at ${most.length} values halfway, computed to know it, the least damped mode was off by ${number(least[last >> 1], 2)} points of damping as a rule and ${number(least[last], 2)} at most (any drawn mode: ${number(most[last], 2)}${hidden ? `; at ${hidden} of them a mode that is not drawn is damped least` : ""}). On release the nearest computed value is shown.`;
}
// Which scenarios of the case the page does not hold, and what opens them.
function wordsOfOthers(opened) {
  const others = Object.keys(opened.systems ?? {}).filter(name => !(name in opened.scenarios));
  return others.length ? ` This page holds ${Object.keys(opened.scenarios).join(", ")}; gfor explore ${opened.case} opens the others of the case: ${others.join(", ")}.` : "";
}
// Damping of the least damped mode [%], below 0 where the system is unstable.
function leastDampingOf(answer) {
  const one = answer.modes.scenarios[0], damping = leastOf(one.modes).damping_percent;
  return one.stable === false ? Math.min(-1e-9, damping) : damping;
}
// Questions that the answers of the page are enough for: which scenario damps most at the sliders' values, ...
function askBestScenario() {
  const values = Object.fromEntries(Object.keys(SAVED.grid).map(name => [name, heldNear(name, state.values[name] ?? ownOf(name))]));
  const tried = SAVED.answers.filter(one => Object.entries(values).every(([name, v]) => one.values[name] === v) && leastOf(one.answer.modes.scenarios[0].modes));
  const sorted = [...tried].sort((one, other) => leastDampingOf(other.answer) - leastDampingOf(one.answer)), titleOf = one => seen.titles[one.scenario] ?? one.scenario;
  const show = make("button", {}, "show it");
  show.addEventListener("click", () => { $("scenario").value = sorted[0].scenario; $("scenario").dispatchEvent(new Event("change")); });
  const others = sorted.slice(1, Math.min(4, sorted.length - 1)).map(one => `${titleOf(one)} ${fixed(leastDampingOf(one.answer), 2)} %`);
  sayElse(`Of ${tried.length} scenarios at these values, ${titleOf(sorted[0])} damps most: ${swingOf(sorted[0].answer)}; ${others.length ? `then ${others.join(", ")}; ` : ""}least does ${titleOf(sorted.at(-1))}, ${fixed(leastDampingOf(sorted.at(-1).answer), 2)} %. `, show);
}
// What was asked when the page was written: of the scenario with which it begins, at the case's values.
const askedBefore = () => (SAVED.beginning.scenario === state.scenario ? SAVED.asked ?? [] : []);
function sayAskedBefore(one) {
  const differ = one.other ? ` They differ by ${differencesOf(one.other, state.scenario).join(", ")}.` : "";
  sayElse(one.answer ? `At the case's values. ${one.words}: ${swingOf(one.answer)}. ${titleNow()}: ${swingOf(one.now)}.${differ}` : `${one.words}: ${one.reason}`);
}
// Between which computed values of a gain the least damped mode comes to the wanted damping.
function askGain(name) {
  const tried = SAVED.grid[name].map(value => ({ value, answer: answerWith(name, value) })).filter(one => one.answer && leastOf(one.answer.modes.scenarios[0].modes));
  const has = one => leastDampingOf(one.answer) >= WANTED_DAMPING, told = one => `${number(one.value)} (${fixed(leastDampingOf(one.answer), 2)} %)`;
  const sorted = [...tried].sort((one, other) => leastDampingOf(other.answer) - leastDampingOf(one.answer)), between = [];
  for (let k = 1; k < tried.length; k++) if (has(tried[k]) !== has(tried[k - 1])) between.push(`${told(tried[k - 1])} and ${told(tried[k])}`);
  const range = `the ${tried.length} computed values of ${name} from ${number(tried[0].value)} to ${number(tried.at(-1).value)}`;
  if (!between.length) { sayElse(has(tried[0]) ? `All of ${range} give ${WANTED_DAMPING} % or more.` : `None of ${range} gives ${WANTED_DAMPING} %: the most has ${told(sorted[0])}.`); return; }
  sayElse(`The least damped mode comes to ${WANTED_DAMPING} % between ${between.join(", and between ")}, which are neighbours among ${range}.`);
}
// At which of some values the system is stable: the fewer ones are named.
function stabilityOf(tried) {
  const [stable, unstable] = [true, false].map(verdict => tried.filter(one => one.answer.modes.scenarios[0].stable === verdict).map(one => number(one.value)));
  if (!unstable.length) return "Stable at all of them. ";
  if (unstable.length === tried.length) return "Unstable at all of them. ";
  return stable.length + unstable.length === tried.length && stable.length < unstable.length ? `Stable at ${stable.join(", ")} only. ` : `Unstable at ${unstable.join(", ")}. `;
}
// The answer with one slider at a computed value, the others as they are.
function answerWith(name, value) {
  const others = SAVED.movers ? {} : Object.fromEntries(Object.keys(SAVED.grid).map(one => [one, heldNear(one, state.values[one] ?? ownOf(one))]));
  const at = SAVED.movers && value === ownOf(name) ? {} : { ...others, [name]: value };
  return SAVED.answers.find(one => one.scenario === state.scenario && Object.keys(one.values).length === Object.keys(at).length && Object.entries(at).every(([n, v]) => one.values[n] === v))?.answer;
}
// The cell between computed values in which some values lie.
const cellAround = wanted => SAVED.cells.find(one => (one.scenario ?? state.scenario) === state.scenario && Object.entries(one.at).every(([key, [low, high]]) => key in wanted && low <= wanted[key] && wanted[key] <= high));
// ... what the double of the case's value does, computed or between two computed values, ...
const isDoubled = name => ownOf(name) > 0 && 2 * ownOf(name) <= SAVED.grid[name].at(-1);
function askDoubled(name) {
  const value = 2 * ownOf(name), near = heldNear(name, value), show = make("button", {}, "show it");
  show.addEventListener("click", () => setSaved(name, near));
  if (near === value) { sayElse(`With ${name} = ${number(value)}: ${swingOf(answerWith(name, value))}. Now: ${swingOf(seen.answer)}. `, show); return; }
  const others = Object.keys(SAVED.movers ? {} : SAVED.grid).map(one => [one, heldNear(one, state.values[one] ?? ownOf(one))]);
  const wanted = { ...Object.fromEntries(others), [name]: value }, cell = cellAround(wanted);
  const least = cell && betweenOf(cell, wanted).sort((a, b) => a.damping - b.damping)[0];
  const between = cell ? `≈ least damped ${fixed(least.hz, 3)} Hz with ${fixed(least.damping, 2)} %, between computed values, halfway off by ${cell.least < 0.01 ? "less than 0.01" : number(cell.least, 2)} points. Computed nearby, ` : "computed nearby, ";
  show.textContent = `show ${number(near)}`;
  sayElse(`With ${name} = ${number(value)}: ${between}with ${number(near)}: ${swingOf(answerWith(name, near))}. Now: ${swingOf(seen.answer)}. `, show);
}
// ... and which value of a slider damps most.
function askBest(name) {
  const tried = SAVED.grid[name].map(value => ({ value, answer: answerWith(name, value) })).filter(one => one.answer && leastOf(one.answer.modes.scenarios[0].modes));
  const best = tried.reduce((one, other) => (leastDampingOf(other.answer) > leastDampingOf(one.answer) ? other : one));
  const show = make("button", {}, "show it");
  show.addEventListener("click", () => setSaved(name, best.value));
  const range = `${number(tried[0].value)} to ${number(tried.at(-1).value)}`;
  const [most, now] = [best.answer, seen.answer].map(answer => fixed(leastDampingOf(answer), 2));
  if (most === now) { sayElse(`None of ${tried.length} computed values of ${name} from ${range} damps more than the one that is shown, ${number(state.values[name] ?? ownOf(name))}, beyond the digits of ${now} %. `, stabilityOf(tried)); return; }
  sayElse(`Of ${tried.length} computed values of ${name} from ${range}, ${number(best.value)} damps most: ${swingOf(best.answer)}. `, stabilityOf(tried), show);
}
