"use strict";
// The map of modes: 1/s to the right, Hz upwards, rays of equal damping.
const view = { x0: null, x1: null, y0: 0, y1: 2 };
const RAYS = [5, 10, 15, 20, 30, 50];
const PAD = { left: 52, right: 14, top: 12, bottom: 38 };

function frame() {
  const box = $("map").getBoundingClientRect();
  const w = Math.max(box.width, 200), h = Math.max(box.height, 200);
  return {
    w, h,
    x: value => PAD.left + (value - view.x0) / (view.x1 - view.x0) * (w - PAD.left - PAD.right),
    y: value => h - PAD.bottom - (value - view.y0) / (view.y1 - view.y0) * (h - PAD.top - PAD.bottom),
    real: px => view.x0 + (px - PAD.left) / (w - PAD.left - PAD.right) * (view.x1 - view.x0),
    hz: py => view.y0 + (h - PAD.bottom - py) / (h - PAD.top - PAD.bottom) * (view.y1 - view.y0),
  };
}
// All that lies near the axis of damping; what decays at once would squeeze the rest together and is a zoom away.
function fitMap() {
  const all = [...seen.modes, ...(seen.pinned?.modes.scenarios[0].modes ?? [])];
  for (const m of followedPaths().flat()) all.push({ real: m.real, frequency_hz: m.hz, damping_percent: m.percent });
  const near = all.filter(m => m.damping_percent < 75), shown = near.length ? near : all;
  const low = Math.min(-0.4, ...shown.map(m => m.real)), high = Math.max(0.15, ...shown.map(m => m.real));
  const wide = high - low;
  Object.assign(view, { x0: low - 0.12 * wide, x1: high + 0.12 * wide, y0: 0, y1: 1.15 * Math.max(0.3, ...shown.map(m => m.frequency_hz)) });
}
function inView(m) {
  const wide = 0.04 * (view.x1 - view.x0);
  return m && m.real > view.x0 + wide && m.real < view.x1 - wide && m.frequency_hz >= view.y0 && m.frequency_hz < view.y1 - 0.04 * (view.y1 - view.y0);
}
function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(k => k * power).find(x => x >= rough);
  const found = [];
  for (let x = Math.ceil(low / step) * step; x <= high + 1e-9; x += step) found.push(Math.abs(x) < 1e-9 * step ? 0 : +x.toPrecision(8));
  return found;
}
const cross = (x, y, r) => `M${x - r} ${y - r}L${x + r} ${y + r}M${x - r} ${y + r}L${x + r} ${y - r}`;

function paintMap() {
  const svg = $("map"), focused = document.activeElement?.dataset?.mode;
  if (view.x0 === null) fitMap();
  const f = frame(), parts = [];
  svg.setAttribute("viewBox", `0 0 ${f.w} ${f.h}`);
  for (const x of ticks(view.x0, view.x1, f.w / 90)) parts.push(draw("path", { class: x === 0 ? "zero" : "grid", d: `M${f.x(x)} ${PAD.top}V${f.h - PAD.bottom}` }), draw("text", { class: "faint", x: f.x(x), y: f.h - PAD.bottom + 15, "text-anchor": "middle" }, number(x)));
  for (const y of ticks(view.y0, view.y1, f.h / 60)) parts.push(draw("path", { class: "grid", d: `M${PAD.left} ${f.y(y)}H${f.w - PAD.right}` }), draw("text", { class: "faint", x: PAD.left - 6, y: f.y(y) + 4, "text-anchor": "end" }, number(y)));
  parts.push(draw("text", { class: "faint", x: f.w - PAD.right, y: f.h - 6, "text-anchor": "end" }, "Real part [1/s]"), draw("text", { class: "faint", x: 12, y: PAD.top + 2, transform: `rotate(-90 12 ${PAD.top + 2})`, "text-anchor": "end" }, "Frequency [Hz]"));
  const clip = draw("g", { "clip-path": "url(#inside)" });
  parts.push(draw("clipPath", { id: "inside" }, draw("rect", { x: PAD.left, y: PAD.top, width: f.w - PAD.left - PAD.right, height: f.h - PAD.top - PAD.bottom })), clip);
  const named = [];  // places of the rays' texts: none over another
  for (const percent of RAYS) {
    const z = percent / 100, slope = -2 * Math.PI * z / Math.sqrt(1 - z * z);  // real part for one Hz
    clip.append(draw("path", { class: "ray", d: `M${f.x(0)} ${f.y(0)}L${f.x(slope * view.y1)} ${f.y(view.y1)}` }));
    const top = slope * view.y1 > view.x0 ? [slope * view.y1, view.y1] : [view.x0, view.x0 / slope];
    const x = Math.max(f.x(top[0]) + 3, PAD.left + 3), y = Math.max(f.y(top[1]) + 12, PAD.top + 12);
    if (top[1] > view.y0 && !named.some(at => Math.abs(at.x - x) < 34 && Math.abs(at.y - y) < 13)) {
      named.push({ x, y });
      clip.append(draw("text", { class: "faint", x, y }, `${percent} %`));
    }
  }
  if ($("trails").checked) {
    for (const trail of seen.trails) {
      if (trail.length > 1) clip.append(draw("path", { class: "trail", d: trail.map((m, k) => `${k ? "L" : "M"}${f.x(m.real)} ${f.y(m.hz)}`).join("") }));
      for (const m of trail.slice(0, -1)) clip.append(draw("circle", { class: "trail-dot", cx: f.x(m.real), cy: f.y(m.hz), r: 2.2 }));
    }
  }
  for (const path of followedPaths()) {
    clip.append(draw("path", { class: "followed", d: path.map((m, k) => `${k ? "L" : "M"}${f.x(m.real)} ${f.y(m.hz)}`).join("") }));
    for (const m of path) clip.append(draw("circle", { class: "followed-dot", cx: f.x(m.real), cy: f.y(m.hz), r: 2.6 }, draw("title", {}, `${m.row}, ${m.column}: ${m.text}`)));
  }
  const partners = pinnedPartners();
  for (const m of seen.pinned?.modes.scenarios[0].modes ?? []) clip.append(draw("rect", { class: "pinned", x: f.x(m.real) - 5, y: f.y(m.frequency_hz) - 5, width: 10, height: 10 }, draw("title", {}, `A: ${fixed(m.frequency_hz, 4)} Hz, ${fixed(m.damping_percent, 2)} %`)));
  seen.modes.forEach((m, k) => {
    const x = f.x(m.real), y = f.y(m.frequency_hz), big = m.name ? 7 : 4.5;
    if (partners[k]) clip.append(draw("path", { class: "link", d: `M${f.x(partners[k].real)} ${f.y(partners[k].frequency_hz)}L${x} ${y}` }));
    const mark = draw("g", { class: `mark${m.real > 0 ? " unstable" : ""}${k === chosenIndex() ? " chosen" : ""}${seen.estimate ? " stale" : ""}`, tabindex: 0, role: "button", "data-mode": k, "aria-label": sentenceOf(m) },
      draw("circle", { cx: x, cy: y, r: 12 }), draw("path", { d: cross(x, y, big) }));
    mark.addEventListener("pointerenter", () => highlight(k));
    mark.addEventListener("pointermove", event => showTip(event, sentenceOf(m)));
    mark.addEventListener("pointerleave", () => { highlight(null); hideTip(); });
    mark.addEventListener("click", () => choose(k));
    mark.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(k); } });
    clip.append(mark);
    if (m.name) clip.append(draw("text", { x: x + 11, y: y - 8 }, m.name));
  });
  if (seen.estimate) seen.estimate.modes.forEach(m => { if (m) clip.append(draw("path", { class: "estimate", d: cross(f.x(m.real), f.y(m.hz), 7) })); });
  if (seen.estimate) parts.push(draw("text", { class: "faint", x: PAD.left + 8, y: PAD.top + 14 }, SAVED ? "light: interpolated, computed on release" : "light: estimates from ∂λ/∂p, exact on release"));
  svg.replaceChildren(...parts);
  if (focused !== undefined) svg.querySelector(`[data-mode="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
}
const sentenceOf = m => `${m.name ? `${m.name}: ` : ""}${fixed(m.frequency_hz, 4)} Hz, damping ${fixed(m.damping_percent, 2)} %, ${fixed(m.real, 4)} 1/s; ${Object.entries(m.components).slice(0, 3).map(([c, x]) => `${c} ${fixed(100 * x, 0)} %`).join(", ")}`;

// Of each mode, the one of A that is the same; null where that is not clear.
function pinnedPartners() {
  const pinned = seen.pinned?.modes.scenarios[0].modes;
  return pinned ? partnersIn(seen.modes, pinned) : [];
}
// A mode is recognised by who takes part in it and by its shape: eigenvalues move past each other, and a case's name may
// fall on another mode. ALIKE: least likeness of a mode with itself elsewhere; APART: by how much any other is less like it.
const ALIKE = 0.5, APART = 0.1, STATES = 7;
function partnersIn(modes, others) {
  const alike = modes.map(m => others.map(o => likeness(m, o)));
  return alike.map((row, k) => {
    const most = Math.max(...row), j = row.indexOf(most);
    const clear = row.every((x, i) => i === j || x < most - APART) && alike.every((r, i) => i === k || r[j] < most - APART);
    return most >= ALIKE && clear ? others[j] : null;
  });
}
// The part of the participation that two modes have in common, times the likeness of their shapes where machines swing.
function likeness(one, other) {
  const [p, q] = [one, other].map(m => Object.fromEntries(m.participation.slice(0, STATES).map(x => [x.state, x.factor])));
  const sum = factors => Object.values(factors).reduce((all, x) => all + x, 0);
  const common = Object.entries(p).reduce((all, [state, x]) => all + Math.min(x, q[state] ?? 0), 0) / Math.max(sum(p), sum(q), 1e-12);
  return one.shape.length > 1 && other.shape.length > 1 ? common * likenessOfShapes(one.shape, other.shape) : common;
}
function likenessOfShapes(one, other) {
  const size = shape => Math.sqrt(shape.reduce((all, s) => all + s.magnitude ** 2, 0));
  let real = 0, imag = 0;
  for (const s of one) for (const t of other.filter(t => t.state === s.state)) {
    const angle = (s.angle_deg - t.angle_deg) * Math.PI / 180;
    real += s.magnitude * t.magnitude * Math.cos(angle); imag += s.magnitude * t.magnitude * Math.sin(angle);
  }
  return Math.hypot(real, imag) / Math.max(size(one) * size(other), 1e-300);
}

function zoomMap(factor, real = (view.x0 + view.x1) / 2, hz = (view.y0 + view.y1) / 2) {
  Object.assign(view, { x0: real + (view.x0 - real) * factor, x1: real + (view.x1 - real) * factor, y0: hz + (view.y0 - hz) * factor, y1: hz + (view.y1 - hz) * factor });
  paintMap();
}
function beginMap() {
  const svg = $("map");
  let from = null;
  svg.addEventListener("wheel", event => {
    event.preventDefault();
    const box = svg.getBoundingClientRect(), f = frame();
    zoomMap(event.deltaY > 0 ? 1.2 : 1 / 1.2, f.real(event.clientX - box.left), f.hz(event.clientY - box.top));
  }, { passive: false });
  svg.addEventListener("pointerdown", event => { if (!event.target.closest(".mark")) { from = { x: event.clientX, y: event.clientY, ...view }; svg.setPointerCapture(event.pointerId); } });
  svg.addEventListener("pointermove", event => {
    if (!from) return;
    const f = frame(), dx = (event.clientX - from.x) / (f.w - PAD.left - PAD.right) * (from.x1 - from.x0), dy = (event.clientY - from.y) / (f.h - PAD.top - PAD.bottom) * (from.y1 - from.y0);
    Object.assign(view, { x0: from.x0 - dx, x1: from.x1 - dx, y0: from.y0 + dy, y1: from.y1 + dy });
    paintMap();
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { from = null; });
  svg.addEventListener("keydown", event => {
    const marks = [...svg.querySelectorAll(".mark")], at = marks.indexOf(document.activeElement);
    if (event.key === "+") zoomMap(1 / 1.3); else if (event.key === "-") zoomMap(1.3); else if (event.key === "0") { fitMap(); paintMap(); }
    else if (event.key === "ArrowRight" || event.key === "ArrowDown") { event.preventDefault(); marks[(at + 1) % marks.length]?.focus(); }
    else if (event.key === "ArrowLeft" || event.key === "ArrowUp") { event.preventDefault(); marks[(at - 1 + marks.length) % marks.length]?.focus(); }
  });
  $("fit").addEventListener("click", () => { if (state.tab === "network") fitNetwork(); else { fitMap(); paintMap(); } });
  $("in").addEventListener("click", () => (state.tab === "network" ? zoomNetwork(1 / 1.3) : zoomMap(1 / 1.3)));
  $("out").addEventListener("click", () => (state.tab === "network" ? zoomNetwork(1.3) : zoomMap(1.3)));
  $("trails").addEventListener("change", paintMap);
  new ResizeObserver(() => { if (seen.modes.length) paintMap(); }).observe(svg);
}
