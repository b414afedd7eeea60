"use strict";
const tooltip = document.getElementById("tooltip");
function show(event, text) {
  tooltip.textContent = text;
  tooltip.style.opacity = 1;
  const box = tooltip.getBoundingClientRect();
  tooltip.style.left = Math.min(event.clientX + 14, innerWidth - box.width - 8) + "px";
  tooltip.style.top = Math.max(4, Math.min(event.clientY + 14, innerHeight - box.height - 8)) + "px";
}
function hide() { tooltip.style.opacity = 0; }
for (const element of document.querySelectorAll("[data-tip]")) {
  element.addEventListener("pointermove", event => show(event, element.dataset.tip));
  element.addEventListener("pointerleave", hide);
}
for (const chart of document.querySelectorAll('svg[data-kind="lines"]')) {
  const curves = [...chart.querySelectorAll("polyline[data-label]")].map(line => ({
    label: line.dataset.label, x: line.dataset.x.split(" ").map(Number), y: line.dataset.y.split(" "),
  }));
  const { x0, x1, left, right, top: upper, bottom } = chart.dataset;
  const cursor = document.createElementNS("http://www.w3.org/2000/svg", "path");
  cursor.setAttribute("class", "cursor");
  chart.append(cursor);
  chart.addEventListener("pointermove", event => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(chart.getScreenCTM().inverse());
    if (at.x < left || at.x > right || at.y < upper || at.y > bottom) { hide(); cursor.removeAttribute("d"); return; }
    const x = +x0 + (at.x - left) / (right - left) * (x1 - x0);
    cursor.setAttribute("d", `M${at.x} ${upper}V${bottom}`);
    const rows = curves.map(curve => {
      let low = 0, high = curve.x.length - 1;
      while (high - low > 1) { const middle = (low + high) >> 1; curve.x[middle] <= x ? low = middle : high = middle; }
      return `${curve.label}: ${curve.y[x - curve.x[low] <= curve.x[high] - x ? low : high]}`;
    });
    show(event, `${chart.dataset.name ?? ""}${x.toPrecision(4)}\n${rows.join("\n")}`);
  });
  chart.addEventListener("pointerleave", () => { hide(); cursor.removeAttribute("d"); });
}
// In a narrow window, a table that does not fit shows a row as a card: each cell below its heading.
const MOST_CARDS = 24;
function fit() {
  for (const box of document.querySelectorAll(".scroll")) {
    const rows = box.querySelectorAll("tbody tr");
    box.classList.remove("cards");
    if (innerWidth > 700 || rows.length > MOST_CARDS || box.scrollWidth <= box.clientWidth + 1) continue;
    box.classList.add("cards");
    const heads = [...box.querySelectorAll("thead th")].map(cell => cell.textContent);
    for (const row of rows) [...row.children].forEach((cell, k) => { cell.dataset.head = heads[k] ?? ""; });
  }
}
addEventListener("resize", fit);
addEventListener("toggle", fit, true); // a table in <details> has no width before it is opened
fit();
addEventListener("beforeprint", () => { for (const d of document.querySelectorAll("details[data-print]")) d.open = true; });
