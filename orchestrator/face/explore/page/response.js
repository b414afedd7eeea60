"use strict";
// Time responses: dashed, the linear model's; solid, the co-simulation's, while it runs. Plots share their time axis.
const span = { from: null, to: null };
// "a.b = channel": a signal of the case, and the recording's channel that is drawn with it.
const wantedPairs = () => state.signals.split(",").map(s => s.split("=").map(x => x.trim())).filter(([s]) => s);
const wantedSignals = () => wantedPairs().map(([s]) => s);
const KINDS = [["run", "", "co-simulation", "#0072b2"], ["linear", " linear", "linear model", "#d55e00"], ["recorded", " recorded", "recorded", "#009e73"]];

function paintSignals() {
  const info = seen.info;
  $("signal-names").replaceChildren(...(info?.signals ?? []).slice(0, 400).map(name => make("option", { value: name })));
  paintEvents();
  $("signals").value = state.signals;
  for (const id of ["linear", "run"]) $(id).disabled = Boolean(SAVED);
  $("recorded").hidden = !seen.beginning?.recorded;
}
const eventsNow = () => state.events ?? seen.info?.events ?? [];
function wordsOf(event) {
  const { type, time, component, ...rest } = event;
  return `at ${typeof time === "number" ? `${time} s` : time}: ${type.replaceAll("_", " ")}${Object.entries(rest).map(([name, value]) => `, ${name} ${typeof value === "object" ? JSON.stringify(value) : value}`).join("")}`;
}
function paintEvents() {
  const events = eventsNow();
  const parts = events.map((event, k) => {
    const away = make("button", { "aria-label": `take away: ${wordsOf(event)}`, title: "take away" }, "×");
    away.addEventListener("click", () => setEvents(events.filter((_, j) => j !== k)));
    return make("span", {}, wordsOf(event), " ", SAVED ? null : away, "; ");
  });
  const back = make("button", {}, "those of the case");
  back.addEventListener("click", () => setEvents(null));
  $("events").replaceChildren("Events: ", ...(parts.length ? parts : ["none; click a bus, line, load or unit in the network. "]), ...(state.events && !SAVED ? [back] : []));
}
// Other events leave the modes as they are; the curves are of the events before.
function setEvents(events) {
  state.events = events === null || same(events, seen.info?.events) ? null : events;
  seen.curves = {};
  keepState();
  paintEvents(); paintPlots(); paintElement();
  compute();
}
// What was asked for and has no curve: a name that is misspelt, or a signal that is not recorded.
const withoutCurve = found => found.undrawn?.length ? `no curve of ${found.undrawn.join(", ")}: no recorded signal has this name, or too many were asked for` : "";
async function linearResponse() {
  const found = await ask("linear response", { ask: "response", ...theCase(), signals: wantedSignals() }, $("run-said"));
  if (!found) { $("run-said").classList.add("bad"); return; }
  $("run-said").textContent = withoutCurve(found);
  takeCurves("linear", Object.entries(found.curves));
}
function takeCurves(kind, curves) {
  for (const c of Object.values(seen.curves)) delete c[kind];
  for (const [name, curve] of curves) (seen.curves[name] ??= {})[kind] = curve;
  seen.curves = Object.fromEntries(Object.entries(seen.curves).filter(([, c]) => Object.keys(c).length));
  paintPlots();
}
async function recordedSignals() {
  const pairs = wantedPairs(), found = await ask("recording", { ask: "recorded", ...theCase(), signals: pairs.map(([s, other]) => other ?? s) }, $("run-said"));
  $("run-said").classList.toggle("bad", !found);
  if (!found) return;
  $("run-said").textContent = `recorded: ${found.of}${found.differs.length ? `; not as the case is now: ${found.differs.slice(0, 4).join("; ")}${found.differs.length > 4 ? ` and ${found.differs.length - 4} more` : ""}` : ""}${found.undrawn?.length ? `; ${withoutCurve(found)}` : ""}`;
  $("signal-names").append(...found.names.slice(0, 400).map(name => make("option", { value: name })));
  const own = Object.fromEntries(pairs.filter(([, other]) => other).map(([s, other]) => [other, s]));
  takeCurves("recorded", Object.entries(found.curves).map(([name, curve]) => [own[name] ?? name, curve]));
}
async function coSimulation() {
  for (const c of Object.values(seen.curves)) delete c.run;
  $("run-said").classList.remove("bad");
  $("run-said").textContent = "the FMUs are started …";
  const found = await ask("co-simulation", { ask: "run", ...theCase(), signals: wantedSignals() }, $("run-said"));
  if (!found) { $("run-said").classList.add("bad"); return; }
  for (const [name, curve] of Object.entries(found.curves)) (seen.curves[name] ??= {}).run = curve;
  const { verdict, remark } = found.answer;
  const ring = found.ring_down ? `; it rings with ${fixed(found.ring_down.frequency_hz, 4)} Hz, ${fixed(found.ring_down.damping_percent, 2)} %` : "";
  const first = make("b", { class: { true: "good", false: "bad" }[found.answer.stable] }, `${verdict}${remark ? `: ${remark}` : ""}`);
  $("run-said").replaceChildren(first, `${ring}${found.ended_early ? `; ended early: ${found.ended_early}` : ""}. Kept in ${found.folder}.${found.undrawn?.length ? `\n${withoutCurve(found)}` : ""}${found.findings.map(text => `\nfound: ${text}`).join("")}`);
  paintPlots();
}
// A part of a run that goes on.
function streamed(part) {
  for (const [name, values] of Object.entries(part.signals)) {
    const curve = (seen.curves[name] ??= {}).run ??= [[], []];
    curve[0].push(...part.time);
    curve[1].push(...values);
  }
  seen.timing["said co-simulation"] = `at ${fixed(part.time.at(-1), 2)} of ${number(part.until)} s`;
  if (state.tab === "response") paintPlots();
}
function paintPlots() {
  if (state.tab !== "response") return;
  const names = Object.keys(seen.curves);
  $("plots").replaceChildren(...(names.length ? names.map(plotOf) : [make("p", { class: "soft" }, SAVED ? "A saved page computes nothing; start gfor explore for responses." : "Ask for the linear response (at once), or run the co-simulation.")]));
}
function plotOf(name) {
  const curves = KINDS.filter(([kind]) => seen.curves[name][kind]?.[0].length).map(([kind, look, text, colour]) => ({ data: seen.curves[name][kind], look, text, colour }));
  for (const [kind, , text] of KINDS) if (kind !== "recorded" && seen.pinnedCurves[name]?.[kind]) curves.push({ data: seen.pinnedCurves[name][kind], look: " pinned-curve", text: `A, ${text}`, colour: "#e69f00" });
  return chartOf(name, curves, span, paintPlots);
}
// A chart is drawn as wide as it stands, so that its words have the page's size on any screen.
const chartWidth = () => Math.min(760, Math.max(300, $("middle").clientWidth - 22));
// Curves over the time; `span` is what is shown of it, and `again` paints all charts that share it.
function chartOf(name, curves, span, again) {
  const W = chartWidth(), H = 210, L = 64, R = 10, T = 8, B = 26;
  const x0 = span.from ?? Math.min(...curves.map(c => c.data[0][0])), x1 = span.to ?? Math.max(...curves.map(c => c.data[0].at(-1)), x0 + 1e-6);
  let low = Infinity, high = -Infinity;
  for (const c of curves) c.data[0].forEach((t, k) => { if (t >= x0 && t <= x1) { low = Math.min(low, c.data[1][k]); high = Math.max(high, c.data[1][k]); } });
  const room = Math.max((high - low) * 0.06, Math.abs(high) * 1e-7, 1e-12);
  low -= room; high += room;
  const x = t => L + (t - x0) / (x1 - x0) * (W - L - R), y = v => H - B - (v - low) / (high - low) * (H - T - B);
  const svg = draw("svg", { class: "chart", viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${name} over the time`, tabindex: 0 });
  for (const t of ticks(x0, x1, Math.ceil(W / 95))) svg.append(draw("path", { class: "grid", d: `M${x(t)} ${T}V${H - B}` }), draw("text", { class: "faint", x: x(t), y: H - 10, "text-anchor": "middle" }, number(t)));
  for (const v of ticks(low, high, 5)) svg.append(draw("path", { class: "grid", d: `M${L} ${y(v)}H${W - R}` }), draw("text", { class: "faint", x: L - 5, y: y(v) + 4, "text-anchor": "end" }, number(v, 6)));
  for (const c of curves) svg.append(draw("path", { class: `curve${c.look}`, stroke: c.colour, d: c.data[0].map((t, k) => [t, c.data[1][k]]).filter(([t]) => t >= x0 && t <= x1).map(([t, v], k) => `${k ? "L" : "M"}${x(t).toFixed(1)} ${y(v).toFixed(1)}`).join("") }));
  const line = draw("path", { class: "cursor" });
  svg.append(line);
  let from = null;
  const timeAt = event => { const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse()); return x0 + (Math.min(Math.max(p.x, L), W - R) - L) / (W - L - R) * (x1 - x0); };
  svg.addEventListener("pointermove", event => {
    const t = timeAt(event);
    line.setAttribute("d", `M${x(t)} ${T}V${H - B}${from !== null ? `M${x(from)} ${T}V${H - B}` : ""}`);
    showTip(event, `${name}\n${fixed(t, 3)} s\n${curves.map(c => `${c.text}: ${number(c.data[1][nearestIn(c.data[0], t)], 6)}`).join("\n")}`);
  });
  svg.addEventListener("pointerdown", event => { from = timeAt(event); });
  svg.addEventListener("pointerup", event => { const to = timeAt(event); if (from !== null && Math.abs(to - from) > 0.01 * (x1 - x0)) { Object.assign(span, { from: Math.min(from, to), to: Math.max(from, to) }); again(); } from = null; });
  svg.addEventListener("dblclick", () => { Object.assign(span, { from: null, to: null }); again(); });
  svg.addEventListener("pointerleave", () => { hideTip(); line.removeAttribute("d"); });
  svg.addEventListener("keydown", event => {
    const wide = x1 - x0, move = { ArrowLeft: -0.2 * wide, ArrowRight: 0.2 * wide }[event.key];
    if (move) { event.preventDefault(); Object.assign(span, { from: x0 + move, to: x1 + move }); again(); }
    if (event.key === "+" || event.key === "-") { const part = event.key === "+" ? 0.15 : -0.2; Object.assign(span, { from: x0 + part * wide, to: x1 - part * wide }); again(); }
    if (event.key === "0") { Object.assign(span, { from: null, to: null }); again(); }
  });
  const key = make("div", { class: "key" }, make("b", {}, name), ...curves.filter((c, k) => curves.findIndex(o => o.text === c.text) === k).map(c => { const sign = make("i"); sign.style.background = c.colour; return make("span", {}, sign, c.text); }));
  return make("div", {}, key, svg);
}
function nearestIn(times, t) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
  return t - times[low] <= times[high] - t ? low : high;
}
function beginResponse() {
  for (const id of ["linear", "run"]) $(id).hidden = Boolean(SAVED);  // a saved page computes nothing
  $("signals").addEventListener("change", () => { state.signals = $("signals").value; keepState(); });
  $("linear").addEventListener("click", linearResponse);
  $("run").addEventListener("click", coSimulation);
  $("recorded").addEventListener("click", recordedSignals);
  $("signals-csv").addEventListener("click", () => {
    const rows = [["signal", "kind", "time [s]", "value"]];
    for (const [name, kinds] of Object.entries(seen.curves)) for (const [kind, curve] of Object.entries(kinds)) if (curve) curve[0].forEach((t, k) => rows.push([name, kind, t, curve[1][k]]));
    download("responses.csv", "text/csv", asCsv(rows));
  });
}
