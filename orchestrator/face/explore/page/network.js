"use strict";
// The single-line diagram: buses where the layout put them, elements that are set by a click.
const lens = { x: 0, y: 0, w: 0, h: 0 };
let element = null;  // kind and name of what was clicked
const MARK = 8;  // from the middle of a transformer's two circles to their end

function fitNetwork() {
  const d = seen.info?.diagram;
  if (d) Object.assign(lens, wholeOf(d));
  paintNetwork();
}
// All buses, with room for what hangs at them and for the arrows; a flat network has a flat picture.
function wholeOf(d) {
  const of = key => d.buses.map(b => state.places[b.name]?.[key === "x" ? 0 : 1] ?? b[key]), room = 30 + hangOf(d) + 70;
  const x = Math.min(...of("x")) - room, y = Math.min(...of("y")) - room, w = Math.max(...of("x")) + room - x, h = Math.max(...of("y")) + room - y;
  $("network").style.aspectRatio = `${w} / ${h}`;
  return { x, y, w, h };
}
const hangOf = d => (d.buses.length <= 12 ? 52 : 30);  // from a bus to what hangs at it
function zoomNetwork(factor, x = lens.x + lens.w / 2, y = lens.y + lens.h / 2) {
  Object.assign(lens, { x: x + (lens.x - x) * factor, y: y + (lens.y - y) * factor, w: lens.w * factor, h: lens.h * factor });
  paintLabels();
}
// Names and figures keep their size on the screen, so that more of them find a place where one zooms in.
let names = { labels: [], taken: [] };
function paintLabels() {
  const svg = $("network"), box = svg.getBoundingClientRect(), group = document.getElementById("names");
  svg.setAttribute("viewBox", `${lens.x} ${lens.y} ${lens.w} ${lens.h}`);
  if (!group || !box.width) return;
  const scale = Math.max(lens.w / box.width, lens.h / box.height), w = box.width * scale, h = box.height * scale;
  const shown = { x0: lens.x + (lens.w - w) / 2, y0: lens.y + (lens.h - h) / 2, x1: lens.x + (lens.w + w) / 2, y1: lens.y + (lens.h + h) / 2 };
  group.replaceChildren(...placedTexts(names.labels, names.taken, 11 * scale, shown));
}
const flowOf = () => { const own = seen.answer?.modes.scenarios[0].power_flow ?? null; return SAVED ? SAVED.flows[own] ?? null : own; };
function things(kind, name, label, ...children) {
  const group = draw("g", { class: `thing${element && element.kind === kind && element.name === name ? " chosen" : ""}`, tabindex: 0, role: "button", "aria-label": label, "data-thing": `${kind} ${name}` }, ...children);
  const pick = () => { element = { kind, name }; paintNetwork(); paintElement(); };
  group.addEventListener("click", pick);
  group.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); pick(); } });
  group.addEventListener("pointermove", event => showTip(event, label));
  group.addEventListener("pointerleave", hideTip);
  return group;
}
// What lines between two buses carry: of several that of each where it is the same, else the sum.
function flowLabel(lines) {
  const [first] = lines, count = lines.length, sum = Math.abs(lines.reduce((all, one) => all + one.p, 0)), mean = key => lines.reduce((all, one) => all + one[key], 0) / count;
  const alike = lines.every(one => fixed(one.p, 0) === fixed(first.p, 0)), several = alike ? `${count} × ${fixed(Math.abs(first.p), 0)} MW` : `${count} lines: ${fixed(sum, 0)} MW`;
  return { x: mean("x"), y: mean("y"), r: lines.some(one => one.marked) ? MARK + 2 : 6, look: "flow", words: [count > 1 ? several : `${fixed(sum, 0)} MW`], size: sum };
}
function paintNetwork() {
  if (state.tab !== "network") return;
  const svg = $("network"), d = seen.info?.diagram, flow = flowOf(), focused = document.activeElement?.dataset?.thing;
  if (!d) { svg.replaceChildren(draw("text", { x: 20, y: 30 }, seen.info ? "this case has no network behind a power flow" : "loading …")); svg.setAttribute("viewBox", "0 0 500 300"); return; }
  if (!lens.w) Object.assign(lens, wholeOf(d));
  svg.setAttribute("viewBox", `${lens.x} ${lens.y} ${lens.w} ${lens.h}`);
  d.buses.forEach(b => { if (state.places[b.name]) [b.x, b.y] = state.places[b.name]; });
  const at = Object.fromEntries(d.buses.map(b => [b.name, b])), volts = Object.fromEntries((flow?.buses ?? []).map(b => [b.name, b]));
  const branches = Object.fromEntries((flow?.branches ?? []).map(b => [b.name, b])), machines = Object.fromEntries((flow?.machines ?? []).map(m => [m.name, m]));
  const most = Math.max(1, ...(flow?.branches ?? []).map(b => Math.abs(b.p_from_mw)));
  const few = d.buses.length <= 45, parts = [], between = {}, beside = {}, flows = [], ofUnits = [];
  names = { labels: [], taken: [] };
  const keepFree = (x, y, r) => names.taken.push({ x0: x - r, y0: y - r, x1: x + r, y1: y + r });
  const middle = { x: d.buses.reduce((s, b) => s + b.x, 0) / d.buses.length, y: d.buses.reduce((s, b) => s + b.y, 0) / d.buses.length };
  for (const line of d.lines) {
    const a = at[line.from], b = at[line.to], key = [line.from, line.to].sort().join("\u0000");
    const nth = between[key] = (between[key] ?? -1) + 1, f = branches[line.name];
    const closed = isOn(line.open) && (f?.closed ?? true), bend = nth ? 14 * Math.ceil(nth / 2) * (nth % 2 ? 1 : -1) : 0;
    const length = Math.hypot(b.x - a.x, b.y - a.y) || 1, mx = (a.x + b.x) / 2 - bend * (b.y - a.y) / length, my = (a.y + b.y) / 2 + bend * (b.x - a.x) / length;
    const path = `M${a.x} ${a.y}Q${mx} ${my} ${b.x} ${b.y}`, p = f ? f.p_from_mw : null;
    const label = `${line.kind} ${line.title}, ${line.from} to ${line.to}: ${closed ? (f ? `${fixed(p, 1)} MW, ${fixed(f.q_from_mvar, 1)} Mvar` : "closed") : "open"}`;
    const wire = draw("path", { class: `wire${closed ? "" : " open"}`, d: path });
    if (p !== null && closed) wire.style.strokeWidth = (1.2 + 4 * Math.abs(p) / most).toFixed(2);
    const group = things("line", line.name, label, draw("path", { class: "hit", d: path }), wire);
    const marked = line.kind === "branch";  // two circles of a transformer, which no word may touch
    if (marked) keepFree(mx, my, MARK);
    if (marked) for (const s of [-1, 1]) group.append(draw("circle", { class: "unit", cx: mx + s * 3 * (b.x - a.x) / length, cy: my + s * 3 * (b.y - a.y) / length, r: 4.5, "fill-opacity": 0 }));
    if (p !== null && closed) {
      const way = p >= 0 ? 1 : -1, ux = way * (b.x - a.x) / length, uy = way * (b.y - a.y) / length;
      group.append(draw("path", { class: "wire", d: arrow(mx - 5 * ux, my - 5 * uy, mx + 6 * ux, my + 6 * uy) }));
      (beside[key] ??= []).push({ x: (mx + (a.x + b.x) / 2) / 2, y: (my + (a.y + b.y) / 2) / 2, p: line.from < line.to ? p : -p, marked });
    }
    parts.push(group);
  }
  flows.push(...Object.values(beside).map(flowLabel));
  const perBus = {};
  const hang = (bus, k, all) => {  // around the bus, away from the middle of the picture
    const out = Math.atan2(bus.y - middle.y, bus.x - middle.x), a = out + (k - (all - 1) / 2) * 0.75;
    return { x: bus.x + hangOf(d) * Math.cos(a), y: bus.y + hangOf(d) * Math.sin(a) };
  };
  for (const one of [...d.units.map(u => ["unit", u]), ...d.loads.map(l => ["load", l])]) (perBus[one[1].bus] ??= []).push(one);
  seen.unitPlaces = {};
  for (const [name, all] of Object.entries(perBus)) all.forEach(([kind, thing], k) => {
    const bus = at[name], p = hang(bus, k, all.length), way = `M${bus.x} ${bus.y}L${p.x} ${p.y}`, stub = draw("g", {}, draw("path", { class: "hit", d: way }), draw("path", { class: "wire", d: way }));
    if (kind === "unit") {
      const m = machines[thing.name], on = isOn(thing.out);
      seen.unitPlaces[thing.name] = p;
      keepFree(p.x, p.y, 10);
      ofUnits.push({ x: p.x, y: p.y, r: 12, look: "flow", words: [thing.title, thing.name] });
      const label = `unit ${thing.title} at ${name}: ${on ? (m ? `${fixed(m.p_mw, 1)} MW, ${fixed(m.q_mvar, 1)} Mvar, ${fixed(m.loading_percent, 0)} % of ${fixed(m.rating_mva, 0)} MVA` : "in service") : "out of service"}`;
      parts.push(things(kind, thing.name, label, stub, thing.machine ? draw("circle", { class: `unit${on ? "" : " out"}`, cx: p.x, cy: p.y, r: 10 }) : draw("rect", { class: `unit${on ? "" : " out"}`, x: p.x - 9, y: p.y - 9, width: 18, height: 18 }), draw("path", { class: "wire", d: `M${p.x - 5} ${p.y}q2.5 -6 5 0t5 0` })));
    } else {
      keepFree(p.x, p.y, 8);
      const scale = thing.scale ? state.values[thing.scale] ?? 1 : 1;
      const label = `load ${thing.title} at ${name}: ${fixed(thing.p_mw * scale, 1)} MW${scale !== 1 ? `, ${number(scale)} times the case's` : ""}`;
      parts.push(things(kind, thing.name, label, stub, draw("path", { class: "load", d: `M${p.x - 6} ${p.y - 4}H${p.x + 6}L${p.x} ${p.y + 7}z` })));
    }
  });
  for (const bus of d.buses) {
    const v = volts[bus.name]?.v_pu, label = `bus ${bus.title}${v ? `: ${fixed(v, 4)} pu, ${fixed(volts[bus.name].angle_deg, 2)}°` : ""}`;
    const dot = things("bus", bus.name, label, draw("circle", { class: `bus${v < 0.95 ? " low" : v > 1.05 ? " high" : ""}`, cx: bus.x, cy: bus.y, r: few ? 6 : 4.5 }));
    dot.addEventListener("pointerdown", event => dragBus(event, bus));
    parts.push(dot);
    keepFree(bus.x, bus.y, 5);
    names.labels.push({ x: bus.x, y: bus.y, r: 8, look: "flow", words: v ? [`${bus.title} ${fixed(v, 3)}`, bus.title, bus.name] : [bus.title, bus.name] });
  }
  names.labels.push(...ofUnits, ...flows.sort((a, b) => b.size - a.size));
  parts.push(draw("g", { id: "names" }), draw("g", { id: "arrows" }));
  svg.replaceChildren(...parts);
  paintLabels();
  paintArrows(1);
  if (focused !== undefined) svg.querySelector(`[data-thing="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
}
// A bus goes where it is dragged; the address and the copied scenario keep its place.
function dragBus(event, bus) {
  const svg = $("network"), place = e => new DOMPoint(e.clientX, e.clientY).matrixTransform(svg.getScreenCTM().inverse()), from = place(event);
  const move = e => {
    const to = place(e);
    if (!state.places[bus.name] && Math.hypot(to.x - from.x, to.y - from.y) < 4) return;
    state.places[bus.name] = [Math.round(to.x), Math.round(to.y)];
    paintNetwork();
  };
  const end = () => { removeEventListener("pointermove", move); removeEventListener("pointerup", end); if (state.places[bus.name]) keepState(); };
  addEventListener("pointermove", move);
  addEventListener("pointerup", end);
}
// The chosen mode's shape at the places of the machines; `part` of the swing, from -1 to 1.
function paintArrows(part) {
  const group = document.getElementById("arrows"), m = seen.modes[chosenIndex()];
  if (!group) return;
  const largest = Math.max(...(m?.shape ?? []).map(s => s.magnitude), 1e-12);
  const length = seen.info.diagram.buses.length <= 45 ? 95 : 60;
  group.replaceChildren(...(m?.shape ?? []).flatMap((s, k) => {
    const p = seen.unitPlaces?.[s.state.split(".")[0]], a = s.angle_deg * Math.PI / 180, r = length * s.magnitude / largest * part;
    return p && Math.abs(r) > 1 ? [draw("path", { class: "arrow", stroke: seenWell(COLOURS[k % COLOURS.length]), d: arrow(p.x, p.y, p.x + r * Math.cos(a), p.y - r * Math.sin(a)) })] : [];
  }));
}
const isOn = name => (name ? (state.values[name] ?? parameterOf(name)?.value ?? true) !== false : true);

function paintElement() {
  const place = $("element"), d = seen.info?.diagram;
  if (!element || !d) { place.replaceChildren(make("p", { class: "soft", title: "Drag a bus to where it belongs; zoom in for all names and flows. Buses: pink above 1.05 pu, orange below 0.95. Dashed red: open or out." }, `Arrows: how the chosen mode swings. Circles are machines, squares converters. ${SAVED ? "Point at a bus, line, unit or load for its figures." : "Click a bus, line, unit or load to change it."}`)); return; }
  const error = make("p", { class: "bad", role: "alert" }), parts = [make("h3", {}, `${element.kind} ${element.name}`)];
  const onOff = (name, text) => {
    const tick = make("input", { type: "checkbox" });
    tick.checked = isOn(name);
    tick.addEventListener("change", () => setOnes({ [name]: tick.checked ? (original(name) === false ? true : null) : false }, error));
    return make("label", { class: "block" }, tick, ` ${text}`);
  };
  const times = (label, now, low, high, apply) => {
    const slider = make("input", { type: "range", min: Math.log(low), max: Math.log(high), step: 0.01, "aria-label": label }), said = make("span", {}, `× ${number(now, 3)}`);
    slider.value = Math.log(now);
    slider.addEventListener("input", () => { said.textContent = `× ${number(Math.exp(+slider.value), 3)}`; });
    slider.addEventListener("change", () => apply(Math.abs(+slider.value) < 0.006 ? 1 : +Math.exp(+slider.value).toPrecision(3)));
    return make("label", { class: "block" }, `${label} `, said, slider);
  };
  const happens = (words, first, unit, most, made) => {
    const size = unit && make("input", { type: "text", size: 5, value: first, inputmode: "decimal", "aria-label": `${words}: ${unit}` }), when = make("input", { type: "text", size: 4, value: 1, inputmode: "decimal", "aria-label": `${words}: time in s` }), add = make("button", {}, "add");
    add.addEventListener("click", () => {
      const x = size ? Number(size.value.replace(",", ".")) : 0, t = Number(when.value.replace(",", "."));
      if (!(t >= 0) || (size && !(x > 0 && x <= most))) { error.textContent = `${words}: the time is a number of at least 0 s${size ? `, and the ${unit} above 0, at most ${most}` : ""}`; return; }
      error.textContent = "";
      setEvents([...eventsNow(), { time: `${t} s`, ...made(x) }]);
    });
    return make("p", { class: "block" }, `${words} `, ...(size ? [size, ` ${unit} `] : []), "at ", when, " s ", add);
  };
  const added = make("p", { class: "soft" }, `Events: ${eventsNow().map(wordsOf).join("; ") || "none"}. The tab Response runs them.`);
  if (element.kind === "bus") parts.push(happens("Three-phase fault here for", 100, "ms", 10000, ms => ({ type: "bus_fault", bus: element.name, duration: `${ms} ms` })));
  else if (element.kind === "line") {
    const line = d.lines.find(l => l.name === element.name);
    if (line.open) parts.push(onOff(line.open, "closed"));
    if (line.length && parameterOf(line.length)) {
      const now = (state.values[line.length] ?? original(line.length)) / original(line.length);
      const scaled = factor => Object.fromEntries([line.length, line.resistance, line.charging].filter(n => n && parameterOf(n) && original(n)).map(n => [n, factor === 1 ? null : original(n) * factor]));
      parts.push(times("Length, times the case's", now, 0.2, 5, factor => setOnes(scaled(factor), error)));
      const per = original(line.length), { minimum, maximum } = parameterOf(line.length);
      if (!SAVED) parts.push(finderOf(`${state.scenario} line ${line.name}`, {
        now: () => (state.values[line.length] ?? original(line.length)) / original(line.length), bounds: () => [minimum === null ? -Infinity : minimum / per, maximum === null ? Infinity : maximum / per],
        valuesAt: scaled, apply: factor => setOnes(scaled(factor), $("element").querySelector("[role=alert]")), words: "length ×",
      }));
    }
    parts.push(happens("It opens", 0, "", 0, () => ({ type: "line_trip", line: element.name })));
  } else if (element.kind === "load") {
    parts.push(happens("It steps to", 101, "% of its power", 1000, x => ({ type: "load_change", load: element.name, scale: x / 100 * (state.values[d.loads.find(l => l.name === element.name).scale] ?? 1) })));
    const load = d.loads.find(l => l.name === element.name);
    if (load.scale) parts.push(times("Load, times the case's", state.values[load.scale] ?? 1, 0.2, 3, factor => setOnes({ [load.scale]: factor === 1 ? null : factor }, error)));
  } else {
    parts.push(happens("It trips", 0, "", 0, () => ({ type: "unit_trip", unit: element.name })));
    const unit = d.units.find(u => u.name === element.name), its = make("button", {}, "its values");
    if (unit.out) parts.push(onOff(unit.out, "in service (what it feeds is shared by the others)"));
    its.addEventListener("click", () => { $("search").value = `${unit.name}.`; paintFound(); $("search").focus(); });
    parts.push(its);
  }
  if (SAVED) {
    place.replaceChildren(parts[0], make("p", { class: "soft" }, "A saved page: only its sliders move. gfor explore opens the case live, where this can be changed."));
    return;
  }
  place.replaceChildren(...parts, added, error);
}
async function setOnes(values, error) {
  const before = [...state.controls];
  for (const [name, value] of Object.entries(values)) if (value === null) delete state.values[name]; else { state.values[name] = value; if (!state.controls.includes(name)) state.controls.push(name); }
  keepState();
  paintControls();
  await compute(error);
  if (!error.textContent) return;
  state.controls = before;
  keepState(); paintControls();
  paintElementAgain(error === $("failure") ? "" : error.textContent);
}
function paintElementAgain(text) { paintElement(); $("element").querySelector("[role=alert]").textContent = text; }

function beginNetwork() {
  const svg = $("network");
  let from = null;
  const scale = () => Math.max(lens.w / svg.clientWidth, lens.h / svg.clientHeight);
  svg.addEventListener("wheel", event => {
    event.preventDefault();
    const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    zoomNetwork(event.deltaY > 0 ? 1.2 : 1 / 1.2, p.x, p.y);
  }, { passive: false });
  svg.addEventListener("pointerdown", event => { if (!event.target.closest(".thing")) { from = { x: event.clientX, y: event.clientY, lx: lens.x, ly: lens.y }; svg.setPointerCapture(event.pointerId); } });
  svg.addEventListener("pointermove", event => { if (from) { lens.x = from.lx - (event.clientX - from.x) * scale(); lens.y = from.ly - (event.clientY - from.y) * scale(); zoomNetwork(1); } });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { from = null; });
  svg.addEventListener("keydown", event => {
    if (event.key === "+") zoomNetwork(1 / 1.3); else if (event.key === "-") zoomNetwork(1.3); else if (event.key === "0") fitNetwork();
    else if (event.key.startsWith("Arrow")) {
      event.preventDefault();
      const all = [...svg.querySelectorAll(".thing")], step = event.key === "ArrowRight" || event.key === "ArrowDown" ? 1 : -1;
      all[(all.indexOf(document.activeElement) + step + all.length) % all.length]?.focus();
    }
  });
  new ResizeObserver(paintLabels).observe(svg);
}
