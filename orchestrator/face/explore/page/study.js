"use strict";
// A study as rows and columns: cells coloured by damping, each a live case by a click.
const TOP = 24, FULL = 20;  // [px], damping with the full colour [%]
let LEFT = 150;  // [px], as the names of the rows need
const cursorAt = { row: 0, column: 0 };
const study = () => seen.beginning?.study ?? null;

// Followed modes of a sweep, as what the map draws: places in the complex plane, row by row.
function followedPaths() {
  const s = study();
  if (!s?.followed) return [];
  return s.cells.map((row, r) => row.map((cell, c) => cell && { ...cell, row: s.rows[r].name, column: s.columns[c].name }).filter(m => m && m.real !== undefined));
}
function sizeOfCells() {
  const s = study(), wide = Math.max(300, $("panel-study").clientWidth - 20);
  LEFT = Math.min(wide / 2, 14 + 7.4 * Math.max(8, ...s.rows.map(row => row.name.length)));
  return { w: Math.max(3, Math.min(96, (wide - LEFT) / s.columns.length)), h: Math.max(7, Math.min(30, 460 / s.rows.length)) };
}
function colourOf(cell) {
  if (!cell) return null;
  if (cell.stable === false || cell.percent < 0) return [213, 94, 0];
  if (cell.percent === undefined || cell.percent === null) return cell.stable ? [86, 180, 233] : [178, 178, 178];
  const part = Math.max(-1, Math.min(1, cell.percent < 5 ? (cell.percent - 5) / 5 : (cell.percent - 5) / (FULL - 5)));
  const end = part < 0 ? [230, 159, 0] : [86, 180, 233];
  return [255, 255, 255].map((x, k) => Math.round(x + (end[k] - x) * Math.abs(part)));
}
const judging = () => study().kind === "certificate";
const signOf = cell => judging() ? { true: "met", false: "NOT met" }[cell.stable] ?? "not judged" : (cell.stable === false ? "U" : cell.percent === undefined || cell.percent === null ? (cell.stable ? "–" : "?") : "");

function paintCells() {
  const s = study();
  if (!s || $("panel-study").hidden) return;
  const canvas = $("cells"), { w, h } = sizeOfCells(), sharp = devicePixelRatio || 1;
  const width = LEFT + w * s.columns.length + 2, height = TOP + h * s.rows.length + 2, style = getComputedStyle(document.documentElement);
  Object.assign(canvas, { width: width * sharp, height: height * sharp });
  Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
  const pen = canvas.getContext("2d");
  pen.scale(sharp, sharp);
  pen.font = "12px sans-serif";
  pen.textBaseline = "middle";
  const ink = style.getPropertyValue("--ink");
  const fit = (text, room) => { let t = text; while (t.length > 1 && pen.measureText(t).width > room) t = `${t.slice(0, -2)}…`; return t; };
  const everyColumn = Math.ceil(54 / w), everyRow = Math.ceil(12 / h);
  pen.fillStyle = ink;
  s.columns.forEach((column, c) => { if (c % everyColumn === 0) pen.fillText(fit(column.name, w * everyColumn - 4), LEFT + c * w + 2, TOP / 2); });
  s.rows.forEach((row, r) => { if (r % everyRow === 0) pen.fillText(fit(row.name, LEFT - 8), 2, TOP + (r + 0.5) * h); });
  s.cells.forEach((row, r) => row.forEach((cell, c) => {
    const colour = colourOf(cell), x = LEFT + c * w, y = TOP + r * h;
    if (!colour) return;
    pen.fillStyle = `rgb(${colour})`;
    pen.fillRect(x, y, w - (w > 6 ? 1 : 0), h - (h > 8 ? 1 : 0));
    const text = [cell.percent !== undefined && cell.percent !== null && w >= 40 ? fixed(cell.percent, 1) : "", w >= 10 ? signOf(cell) : ""].filter(Boolean).join(" ");
    if (text && h >= 12) { pen.fillStyle = "#000"; pen.fillText(text, x + 4, y + h / 2); }
  }));
  pen.strokeStyle = style.getPropertyValue("--focus");
  pen.lineWidth = 2;
  pen.strokeRect(LEFT + cursorAt.column * w, TOP + cursorAt.row * h, w, h);
}
function cellUnder(event) {
  const s = study(), box = $("cells").getBoundingClientRect(), { w, h } = sizeOfCells();
  const column = Math.floor((event.clientX - box.left - LEFT) / w), row = Math.floor((event.clientY - box.top - TOP) / h);
  return row >= 0 && column >= 0 && row < s.rows.length && column < s.columns.length ? { row, column } : null;
}
const saidOf = at => { const s = study(); return `${s.rows[at.row].name}, ${s.columns[at.column].name}: ${s.cells[at.row][at.column]?.text ?? "nothing was computed or followed there"}`; };

// Open a cell as a live case, and say its figure beside the live one.
async function openCell(at) {
  const s = study(), row = s.rows[at.row], column = s.columns[at.column];
  Object.assign(cursorAt, at);
  paintCells();
  $("study-said").textContent = saidOf(at);
  if (judging()) return showPictures(at);
  if (SAVED || !row.values || !column.values || !s.cells[at.row][at.column]) return;
  const scenario = row.scenario || column.scenario || s.scenario, values = { ...s.values, ...row.values, ...column.values };
  const found = await ask("the cell", { ask: "cell", scenario, values, base: s.values, step: s.step, own: column.out, lost: row.out, sharing: s.sharing, move_controls: s.move_controls }, $("study-said"));
  if (!found) return;
  Object.assign(state, { scenario, events: null, values: found.values, controls: Object.keys(found.values).slice(0, 8), range: s.range });
  $("scenario").value = scenario;
  $("low").value = s.range[0]; $("high").value = s.range[1];
  keepState(); paintControls();
  if (!await compute($("study-said"))) return;
  const least = [...seen.modes].sort((a, b) => a.damping_percent - b.damping_percent)[0];
  if (least) $("study-said").textContent = `Open now: ${saidOf(at)}. Live, least damped: ${fixed(least.frequency_hz, 3)} Hz, ${fixed(least.damping_percent, 2)} %.`;
}
// A certificate's row: its response in its limits.
function showPictures(at) {
  const shown = { from: null, to: null };
  const again = () => $("study-plots").replaceChildren(...(study().cells[at.row][at.column]?.pictures ?? []).map(one => {
    const curves = one.curves.filter(c => c.data[0].length).map(c => ({ ...c, look: c.dashed ? " limit" : "" }));
    return make("div", {}, chartOf(one.label, curves, shown, again), make("p", { class: "soft" }, one.caption));
  }));
  again();
}
function beginStudy() {
  const s = study(), canvas = $("cells");
  if (!s) return;
  $("tab-study").hidden = false;
  $("study-title").textContent = s.title;
  $("study-scale").textContent = judging() ? "Blue: met; orange: not met; grey: not judged. Red in a response: its limits." : `Orange: below 5 %; blue: above, full at ${FULL} %; U: unstable; –: nothing below the limit of the search; ?, grey: not judged.${s.left_out ? ` ${s.left_out} rows are not shown: they are better than these.` : ""}`;
  if (judging()) $("study-said").textContent = "Click a row: its criteria, and its response in its limits. Modes, network and response are of the first row's bench.";
  else if (!s.rows[0].values) $("study-said").textContent = "These cells are systems of the study's own; none opens as a live case.";
  if (!location.hash) state.tab = "study";
  const moved = Object.keys(s.columns[0]?.values ?? {});
  if (s.followed && moved.length < 4) for (const name of moved) if (!state.controls.includes(name)) state.controls.push(name);
  canvas.addEventListener("pointermove", event => { const at = cellUnder(event); if (at) showTip(event, saidOf(at)); else hideTip(); });
  canvas.addEventListener("pointerleave", hideTip);
  canvas.addEventListener("click", event => { const at = cellUnder(event); if (at) openCell(at); });
  canvas.addEventListener("keydown", event => {
    const step = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0] }[event.key];
    if (step) {
      event.preventDefault();
      cursorAt.row = Math.min(s.rows.length - 1, Math.max(0, cursorAt.row + step[0]));
      cursorAt.column = Math.min(s.columns.length - 1, Math.max(0, cursorAt.column + step[1]));
      $("study-said").textContent = saidOf(cursorAt);
      paintCells();
    } else if (event.key === "Enter") openCell({ ...cursorAt });
  });
  new ResizeObserver(paintCells).observe($("panel-study"));
}
