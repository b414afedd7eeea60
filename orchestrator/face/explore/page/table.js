"use strict";
// The table of modes, and what is said of the one that is chosen.
const order = { by: null, up: true };
const GROWTH = "σ [1/s]";  // for which a telephone has no room
const COLUMNS = [
  ["f [Hz]", m => m.frequency_hz, m => fixed(m.frequency_hz, 4)],
  ["Damping [%]", m => m.damping_percent, m => fixed(m.damping_percent, 2)],
  [GROWTH, m => m.real, m => fixed(m.real, 4)],
  ["Name", m => m.name ?? "", m => m.name ?? ""],
  ["Who", m => Object.keys(m.components)[0] ?? "", m => Object.entries(m.components).slice(0, 2).map(([c, x]) => `${c}\u00a0${fixed(100 * x, 0)}\u00a0%`).join(", ")],
];

// Place of the chosen mode among those that are there; the least damped one where it is gone.
function chosenIndex() {
  if (state.mode === null) return -1;
  if (typeof state.mode === "string") return seen.modes.findIndex(m => m.name === state.mode);
  return state.mode < seen.modes.length ? state.mode : -1;
}
function choose(k) {
  state.mode = k === null ? null : seen.modes[k]?.name ?? k;
  keepState();
  paintMap(); paintTable(); paintChosen(); paintNetwork();
}
const nameOrPlace = mode => (mode ? mode.name ?? seen.modes.indexOf(mode) : null);
function highlight(k) {
  for (const element of document.querySelectorAll("#map .mark, #table tbody tr")) element.classList.toggle("hover", k !== null && element.dataset.mode === String(k));
}

function paintTable() {
  const partners = pinnedPartners(), estimated = seen.estimate;
  const columns = [...COLUMNS];
  if (seen.pinned) columns.splice(2, 1, ["Δf from A", (m, k) => (partners[k] ? m.frequency_hz - partners[k].frequency_hz : -Infinity), (m, k) => (partners[k] ? fixed(m.frequency_hz - partners[k].frequency_hz, 4) : "–")],
    ["Δdamping", (m, k) => (partners[k] ? m.damping_percent - partners[k].damping_percent : -Infinity), (m, k) => (partners[k] ? fixed(m.damping_percent - partners[k].damping_percent, 2) : "–")]);
  const table = $("table"), focused = document.activeElement?.closest?.("#table tr")?.dataset.mode;
  table.tHead.rows[0].replaceChildren(...columns.map(([name], k) => {
    const sort = make("button", { "aria-label": `sort by ${name}` }, `${name}${order.by === name ? (order.up ? " ▲" : " ▼") : ""}`);
    sort.addEventListener("click", () => { order.up = order.by === name ? !order.up : true; order.by = name; paintTable(); });
    return make("th", { class: k >= columns.length - 2 ? "text" : name === GROWTH ? "growth" : null, scope: "col", "aria-sort": order.by === name ? (order.up ? "ascending" : "descending") : null }, sort);
  }));
  const shown = seen.modes.map((m, k) => [m, k]);
  const by = columns.find(([name]) => name === order.by);
  if (by) shown.sort(([a, i], [b, j]) => { const x = by[1](a, i), y = by[1](b, j); return (x < y ? -1 : x > y ? 1 : 0) * (order.up ? 1 : -1); });
  table.tBodies[0].replaceChildren(...shown.map(([m, k]) => {
    const e = estimated?.modes[k];
    const cells = columns.map(([name, , text], c) => make("td", { class: c >= columns.length - 2 ? "text" : name === GROWTH ? "growth" : null },
      e && name === "f [Hz]" ? `≈ ${fixed(e.hz, 3)}` : e && name === "Damping [%]" ? `≈ ${fixed(e.damping, 1)}` : e && name === GROWTH ? `≈ ${fixed(e.real, 3)}` : text(m, k)));
    const row = make("tr", { "data-mode": k, tabindex: 0, class: `${k === chosenIndex() ? "chosen" : ""}${e ? " estimated" : ""}`, "aria-selected": k === chosenIndex() }, ...cells);
    row.addEventListener("click", () => choose(k));
    row.addEventListener("keydown", event => {
      if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(k); }
      if (event.key === "ArrowDown") row.nextElementSibling?.focus();
      if (event.key === "ArrowUp") row.previousElementSibling?.focus();
    });
    row.addEventListener("pointerenter", () => highlight(k));
    row.addEventListener("pointerleave", () => highlight(null));
    row.addEventListener("focus", () => highlight(k));
    row.addEventListener("blur", () => highlight(null));
    return row;
  }));
  table.caption?.remove();
  if (seen.pinned) table.prepend(make("caption", { class: "soft" }, `Against A, a mode is recognised by who takes part in it and by its shape, not by its name${partners.includes(null) ? "; –: no mode of A is clearly the same" : ""}.`));
  if (focused !== undefined) table.querySelector(`tr[data-mode="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
}

function bars(title, entries) {
  return [make("h3", {}, title), ...entries.map(([name, share]) => make("div", { class: "bar" }, make("span", {}, name), make("meter", { min: 0, max: 1, value: share, "aria-label": `${name} ${fixed(100 * share, 1)} %` }), make("span", {}, fixed(share, 2))))];
}
// Who swings against whom in the mode at a place, in the words of `gfor modes`.
const swingers = place => seen.answer.swings?.[place] ?? "";
let turning = null;
function paintChosen() {
  cancelAnimationFrame(turning);
  const m = seen.modes[chosenIndex()], place = $("chosen");
  if (!m) { place.replaceChildren(make("p", { class: "soft" }, "Choose a mode in the map or the table: participation and shape.")); return; }
  const who = swingers(chosenIndex());
  const moving = make("input", { type: "checkbox", id: "moving" });
  const shape = draw("svg", { class: "shape", viewBox: "-150 -115 300 230", role: "img", "aria-label": `Mode shape: ${m.shape.map(s => `${s.state} ${number(s.magnitude, 2)} at ${fixed(s.angle_deg, 0)}°`).join("; ")}` });
  const largest = Math.max(...m.shape.map(s => s.magnitude), 1e-12);
  const paint = turn => {
    const tips = [];
    shape.replaceChildren(draw("circle", { class: "ray", cx: 0, cy: 0, r: 90 }), draw("path", { class: "grid", d: "M-95 0H95M0 -95V95" }),
      ...m.shape.filter(s => s.magnitude > 0.02 * largest).flatMap((s, k) => {
        const a = s.angle_deg * Math.PI / 180 + turn, r = 90 * s.magnitude / largest, x = r * Math.cos(a), y = -r * Math.sin(a);
        tips.push({ x, y, r: 5, first: [Math.cos(a), -Math.sin(a)], words: [s.state.split(".")[0]], size: r });
        return [draw("path", { class: "arrow", stroke: seenWell(COLOURS[k % COLOURS.length]), d: arrow(0, 0, x, y) })];
      }), ...placedTexts(tips.sort((a, b) => b.size - a.size), [], 12));
  };
  const animate = () => { paint(performance.now() / 1000 * 2 * Math.PI * Math.min(1, m.frequency_hz)); paintArrows(Math.cos(performance.now() / 1000 * 2 * Math.PI * Math.min(1, m.frequency_hz))); turning = requestAnimationFrame(animate); };
  moving.addEventListener("change", () => { cancelAnimationFrame(turning); if (moving.checked) animate(); else { paint(0); paintArrows(1); } });
  paint(0);
  const swings = m.shape.length ? [make("label", {}, moving, " move (slowed to 1 Hz at most)"), shape] : [make("p", { class: "soft" }, "No machine swings in it.")];
  place.replaceChildren(
    make("h3", {}, `${m.name ?? "Mode"}: ${fixed(m.frequency_hz, 4)} Hz, ${fixed(m.damping_percent, 2)} %`), ...(who ? [make("p", {}, who)] : []),
    make("h3", {}, "Shape "), ...swings,
    ...bars("Participation by component", Object.entries(m.components).slice(0, 6)),
    ...bars("Participation by state", m.participation.slice(0, 8).map(p => [p.state, p.factor])));
}
function arrow(x0, y0, x1, y1) {
  const a = Math.atan2(y1 - y0, x1 - x0), r = Math.min(8, Math.hypot(x1 - x0, y1 - y0) / 2);
  return `M${x0} ${y0}L${x1} ${y1}M${x1 - r * Math.cos(a - 0.45)} ${y1 - r * Math.sin(a - 0.45)}L${x1} ${y1}L${x1 - r * Math.cos(a + 0.45)} ${y1 - r * Math.sin(a + 0.45)}`;
}
