"use strict";
const D = JSON.parse(document.getElementById("data").textContent);
const element = id => document.getElementById(id);
const RAD = Math.PI / 180, FONT = "px system-ui, 'Segoe UI', Roboto, 'Liberation Sans', Arial, sans-serif";
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
const LUT = bytes(D.colours);
const CROSS = "#39d0ff";

// ---- The outgoing directions that every incident direction has (see specularia.report._view_data.Grid).
const G = D.grid, BASE_N = Math.round(180 / G.step), FINE_N = 2 * G.half + 1, SECTION_N = Math.round(180 / G.section);
const baseX = [], baseY = [], baseIndex = new Int32Array(BASE_N * BASE_N).fill(-1);
for (let row = 0; row < BASE_N; row++) for (let col = 0; col < BASE_N; col++) {
  const x = (col + .5) * G.step - 90, y = (row + .5) * G.step - 90;
  if (Math.hypot(x, y) < 90) { baseIndex[row * BASE_N + col] = baseX.length; baseX.push(x); baseY.push(y); }
}
const BASE = baseX.length, FINE = FINE_N * FINE_N, STRIDE = BASE + FINE + SECTION_N;
const sectionAngle = k => (k + .5) * G.section - 90;
const turning = D.phi.length > 1;

const state = { side: D.sides[0], band: D.bands[0] ?? "", theta: 0, phi: 0, at: null, locked: true, az: -56, el: 24 };
const thetaI = () => D.theta[state.theta];

// Codes of one side of a model, unpacked when first asked for.
const unpacked = new WeakMap();
function numbers(part) {
  if (!unpacked.has(part)) {
    const raw = bytes(part.codes), view = new DataView(raw.buffer), codes = new Uint16Array(raw.length / 2);
    for (let i = 0; i < codes.length; i++) codes[i] = view.getUint16(2 * i, true);
    unpacked.set(part, { codes, errors: part.errors === null ? null : bytes(part.errors) });
  }
  return unpacked.get(part);
}
const shownBand = model => model.bands[state.band] ? state.band : Object.keys(model.bands).length === 1 ? Object.keys(model.bands)[0] : null;
const partOf = model => { const band = shownBand(model); return band === null ? null : model.bands[band][state.side] || null; };
const phiIndex = model => model.isotropic ? 0 : D.phi.indexOf(state.phi);
const phiCount = model => model.isotropic ? 1 : D.phi.length;
const start = model => (state.theta * phiCount(model) + phiIndex(model)) * STRIDE;
const decode = (part, code) => code === 0 ? NaN : code === 1 ? 0 : Math.pow(10, part.low + (code - 2) * part.step);
const decodeError = (code, value) => code === 0 ? NaN
  : value * Math.pow(10, D.error[0] + (code - 1) * (D.error[1] - D.error[0]) / D.error[2]);

// Place of a direction among the held ones, from (x, y) on the map in degrees; (cx, cy) is the undeflected one.
function indexAt(x, y, cx, cy) {
  const col = Math.round((x - cx) / G.fine), row = Math.round((y - cy) / G.fine);
  if (col <= G.half && col >= -G.half && row <= G.half && row >= -G.half) {
    const gx = cx + col * G.fine, gy = cy + row * G.fine;
    if (gx * gx + gy * gy < 8100) return BASE + (row + G.half) * FINE_N + col + G.half;
  }
  const found = baseAt(x, y);
  if (found >= 0) return found;
  const k = (90 - .75 * G.step) / Math.hypot(x, y); // On the rim: the last one inside.
  return baseAt(x * k, y * k);
}
function baseAt(x, y) {
  const col = Math.min(BASE_N - 1, Math.max(0, Math.floor((x + 90) / G.step))), row = Math.min(BASE_N - 1, Math.max(0, Math.floor((y + 90) / G.step)));
  return baseIndex[row * BASE_N + col];
}
const centreAt = phi => [-thetaI() * Math.cos(phi * RAD), -thetaI() * Math.sin(phi * RAD)];
function directionAt(index, phi) {
  if (index < BASE) return [baseX[index], baseY[index]];
  const k = index - BASE;
  const [cx, cy] = centreAt(phi);
  return [cx + (k % FINE_N - G.half) * G.fine, cy + (Math.floor(k / FINE_N) - G.half) * G.fine];
}
// An isotropic model is held for light from the azimuth 0 and turned with it.
const turn = (x, y, a) => { const c = Math.cos(a * RAD), s = Math.sin(a * RAD); return [x * c - y * s, x * s + y * c]; };
function lookUp(model, x, y) {
  if (!model.isotropic) { const index = indexAt(x, y, ...centreAt(state.phi)); return [index, ...directionAt(index, state.phi)]; }
  const index = indexAt(...turn(x, y, -state.phi), ...centreAt(0));
  return [index, ...turn(...directionAt(index, 0), state.phi)];
}
function valuesAt(model, x, y) {
  const part = partOf(model), [index, gx, gy] = lookUp(model, x, y), polar = Math.hypot(gx, gy);
  const { codes, errors } = numbers(part), place = start(model) + index;
  const bsdf = decode(part, codes[place]);
  return {
    polar, theta: state.side.startsWith("transmission") === state.side.endsWith("front") ? 180 - polar : polar,
    phi: (Math.atan2(gy, gx) / RAD + 360) % 360, bsdf, dsf: bsdf * Math.cos(polar * RAD),
    error: errors === null ? NaN : decodeError(errors[place], bsdf),
  };
}

// One scale for all models and incident directions of a side, or one for each model: five decades below the next
// half decade above the largest value.
function scale(model) {
  const parts = (state.locked ? D.models : [model]).map(partOf).filter(Boolean);
  const high = Math.ceil(2 * Math.log10(Math.max(1e-12, ...parts.map(p => p.top)))) / 2;
  return [high - D.decades, high];
}
// The page's own colours, asked for once per drawing.
let inks = new Map();
function ink(name) {
  if (!inks.has(name)) inks.set(name, getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim());
  return inks.get(name);
}
// Colours of series are set for white paper; on black they are lightened.
function onPaper(hex) {
  if (!dark()) return hex;
  const part = k => parseInt(hex.slice(k, k + 2), 16), lift = v => Math.round(v + (255 - v) * .45);
  return `rgb(${lift(part(1))},${lift(part(3))},${lift(part(5))})`;
}
function fit(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const w = Math.max(1, Math.round(box.width * ratio)), h = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, box.width, box.height);
  return [g, box.width, box.height];
}

function capture(canvas, event) {
  try { canvas.setPointerCapture(event.pointerId); } catch { /* A pointer that is gone already. */ }
}

// ---- Panels, one per model.
const radius = w => w / 2 - 30;
function make(tag, name, parent, text) {
  const found = document.createElement(tag);
  if (name) found.className = name;
  if (text) found.textContent = text;
  parent.append(found);
  return found;
}
const panels = D.models.map((model, k) => {
  const figure = make("figure", "", element("maps"));
  const head = make("h2", "", figure, model.name + " "), band = make("span", "", head);
  const swatch = make("i", "swatch", head);
  head.prepend(swatch);
  const map = make("canvas", "map", figure), value = make("p", "value", figure);
  value.id = "value-" + k;
  const tau = make("p", "tau", figure);
  tau.id = "tau-" + k;
  const lobe = make("canvas", "lobe", figure);
  map.id = "map-" + k; lobe.id = "lobe-" + k;
  map.tabIndex = lobe.tabIndex = 0;
  map.setAttribute("role", "img"); lobe.setAttribute("role", "img");
  lobe.setAttribute("aria-label", `Lobe of ${model.name}; arrow keys turn it`);
  const inner = document.createElement("canvas");
  const point = event => {
    const box = map.getBoundingClientRect(), r = radius(box.width);
    const x = (event.clientX - box.left - box.width / 2) / r * 90, y = -(event.clientY - box.top - box.height / 2) / r * 90;
    state.at = Math.hypot(x, y) < 90 ? [x, y] : null;
    draw();
  };
  map.addEventListener("pointermove", point);
  map.addEventListener("pointerdown", point);
  map.addEventListener("pointerleave", event => { if (event.pointerType === "mouse") { state.at = null; draw(); } });
  map.addEventListener("keydown", event => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step) return;
    event.preventDefault(); event.stopPropagation();
    const size = event.shiftKey ? 5 : .5, from = state.at || turn(-thetaI(), 0, state.phi);
    const to = [from[0] + size * step[0], from[1] + size * step[1]];
    if (Math.hypot(...to) < 90) state.at = to;
    draw();
  });
  let held = null;
  lobe.addEventListener("pointerdown", event => { held = [event.clientX, event.clientY]; capture(lobe, event); });
  lobe.addEventListener("pointermove", event => {
    if (!held) return;
    look(state.az - .5 * (event.clientX - held[0]), state.el + .5 * (event.clientY - held[1]));
    held = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) lobe.addEventListener(end, () => { held = null; });
  lobe.addEventListener("keydown", event => {
    const step = { ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
    if (!step) return;
    event.preventDefault(); event.stopPropagation();
    look(state.az + step[0], state.el + step[1]);
  });
  return { model, band, swatch, map, inner, tau, value, lobe };
});
function look(az, el) { state.az = az; state.el = Math.max(-85, Math.min(85, el)); draw(); }

function paintMap(panel, cells) {
  const n = cells.n, part = partOf(panel.model), [low, high] = scale(panel.model);
  if (panel.inner.width !== n) panel.inner.width = panel.inner.height = n;
  const g0 = panel.inner.getContext("2d"), image = g0.createImageData(n, n), data = image.data;
  const codes = part ? numbers(part).codes : null, first = start(panel.model), index = cells.index(panel.model);
  // The step of the colour map is linear in the code: from + code * by + log10(cosine) * per.
  const per = 256 / (high - low), by = part ? part.step * per : 0, from = part ? (part.low - 2 * part.step - low) * per : 0;
  for (let i = 0; i < n * n; i++) {
    const cell = index[i];
    if (cell < 0) continue;
    const code = codes ? codes[first + cell] : 0, o = 4 * i;
    data[o + 3] = 255;
    if (code === 0) { data[o] = data[o + 1] = data[o + 2] = (i % n + Math.floor(i / n)) % 8 < 2 ? 150 : 206; continue; }
    const level = code === 1 ? 0 : (from + code * by + cells.logCosine[cell] * per) | 0;
    const c = 3 * (level < 0 ? 0 : level > 255 ? 255 : level);
    data[o] = LUT[c]; data[o + 1] = LUT[c + 1]; data[o + 2] = LUT[c + 2];
  }
  g0.putImageData(image, 0, 0);
  const [g, w] = fit(panel.map), c = w / 2, r = radius(w);
  g.save();
  g.beginPath(); g.arc(c, c, r, 0, 2 * Math.PI); g.clip();
  g.drawImage(panel.inner, c - r, c - r, 2 * r, 2 * r);
  g.restore();
  g.lineWidth = 1; g.font = "10" + FONT; g.textAlign = "center"; g.textBaseline = "middle";
  for (const ring of [30, 60]) {
    g.strokeStyle = "rgba(255,255,255,.45)";
    g.beginPath(); g.arc(c, c, r * ring / 90, 0, 2 * Math.PI); g.stroke();
    g.fillStyle = "rgba(255,255,255,.85)";
    g.fillText(ring + "°", c + r * ring / 90 * Math.cos(67.5 * RAD), c - r * ring / 90 * Math.sin(67.5 * RAD));
  }
  g.strokeStyle = g.fillStyle = ink("soft");
  g.beginPath(); g.arc(c, c, r, 0, 2 * Math.PI); g.stroke();
  for (let phi = 0; phi < 360; phi += 30) {
    const x = Math.cos(phi * RAD), y = -Math.sin(phi * RAD);
    g.beginPath(); g.moveTo(c + r * x, c + r * y); g.lineTo(c + (r + 4) * x, c + (r + 4) * y); g.stroke();
    if (phi % 90 === 0) {
      g.textAlign = phi === 0 ? "right" : phi === 180 ? "left" : "center";
      g.fillText(phi + "°", phi % 180 ? c : c + 0.5 * w * x, c + (r + 14) * y);
    }
  }
  // The cross is open in the middle, so that it hides no peak.
  const [ux, uy] = turn(-thetaI(), 0, state.phi), x = c + r * ux / 90, y = c - r * uy / 90;
  g.strokeStyle = CROSS; g.lineWidth = 1.5;
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    g.beginPath(); g.moveTo(x + 7 * dx, y + 7 * dy); g.lineTo(x + 13 * dx, y + 13 * dy); g.stroke();
  }
  if (state.at) {
    g.strokeStyle = "#fff"; g.lineWidth = 1.5;
    g.beginPath(); g.arc(c + r * state.at[0] / 90, c - r * state.at[1] / 90, 5, 0, 2 * Math.PI); g.stroke();
  }
}
// Which held direction each pixel of a map shows; the same for all models that are held alike.
function mapCells() {
  const box = panels[0].map.getBoundingClientRect(), ratio = Math.min(2, window.devicePixelRatio || 1);
  const n = Math.max(60, Math.min(420, Math.round(2 * radius(box.width) * ratio))), made = new Map();
  const logCosine = new Float32Array(BASE + FINE);
  // The polar angle, and so the cosine, does not change when an isotropic model is turned.
  const centre = D.models.every(m => m.isotropic) ? 0 : state.phi;
  for (let i = 0; i < BASE + FINE; i++) {
    const polar = Math.hypot(...directionAt(i, centre));
    logCosine[i] = polar < 90 ? Math.log10(Math.cos(polar * RAD)) : 0;
  }
  const index = model => {
    if (!made.has(model.isotropic)) {
      const out = new Int32Array(n * n).fill(-1), c = model.isotropic ? Math.cos(state.phi * RAD) : 1, s = model.isotropic ? Math.sin(state.phi * RAD) : 0;
      const [cx, cy] = centreAt(model.isotropic ? 0 : state.phi);
      for (let row = 0; row < n; row++) for (let col = 0; col < n; col++) {
        const x = ((col + .5) / n - .5) * 180, y = (.5 - (row + .5) / n) * 180;
        if (x * x + y * y <= 8300) out[row * n + col] = indexAt(x * c + y * s, y * c - x * s, cx, cy);
      }
      made.set(model.isotropic, out);
    }
    return made.get(model.isotropic);
  };
  return { n, index, logCosine };
}

const exponent = v => (v < 0 ? "−" : "") + Math.abs(v);
function number(value, digits) {
  if (value >= 1e-3 && value < 1e4) return value.toPrecision(digits);
  const [a, e] = value.toExponential(digits - 1).split("e");
  return `${a}·10${[...exponent(Number(e))].map(c => ({ "−": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" })[c]).join("")}`;
}
function report(panel) {
  const part = partOf(panel.model), symbol = state.side.startsWith("t") ? "τ" : "ρ", band = shownBand(panel.model);
  panel.band.textContent = band || "";
  panel.swatch.style.background = onPaper(panel.model.colour);
  const tau = part ? part.tau[state.theta][phiIndex(panel.model)] : null;
  const beyond = part && part.last !== null && thetaI() > part.last + 1e-9;
  const origin = part && part.origin.startsWith("reciprocity") ? "; by reciprocity" : "";
  panel.tau.textContent = !part ? (band === null ? "no data in this band" : "no data on this side") : tau === null ? "no data at this angle"
    : `${symbol} = ${tau.toFixed(4)}${beyond ? " (extrapolated)" : ""}${origin}`;
  panel.tau.dataset.value = tau === null ? "" : String(tau);
  const data = panel.value.dataset;
  data.value = data.dsf = data.error = data.theta = data.phi = "";
  if (!state.at || !part) { panel.value.textContent = ""; return; }
  const found = valuesAt(panel.model, ...state.at);
  Object.assign(data, { value: found.bsdf, dsf: found.dsf, error: found.error, theta: found.theta, phi: found.phi });
  panel.value.textContent = `θₛ ${found.theta.toFixed(1)}°, φₛ ${found.phi.toFixed(1)}° (${found.polar.toFixed(1)}° off the normal): `
    + (Number.isNaN(found.bsdf) ? "no data" : found.bsdf === 0 ? "at or below 0"
      : `BSDF ${number(found.bsdf, 4)}${Number.isNaN(found.error) ? "" : ` ± ${number(found.error, 2)}`} /sr, DSF ${number(found.dsf, 4)} /sr`);
}

// ---- The incident direction, on a small hemisphere seen from the front.
const hemisphere = element("incident");
function aim(x, y) {
  const polar = Math.min(90, Math.hypot(x, y));
  state.theta = D.theta.reduce((best, a, i) => Math.abs(a - polar) < Math.abs(D.theta[best] - polar) ? i : best, 0);
  if (polar > .5) setPhi(Math.atan2(y, x) / RAD);
  draw();
}
const apart = (a, b) => Math.abs((a - b + 540) % 360 - 180);
function setPhi(phi) {
  phi = ((Math.round(phi) % 360) + 360) % 360;
  state.phi = turning ? D.phi.reduce((best, a) => apart(a, phi) < apart(best, phi) ? a : best, D.phi[0]) : phi;
}
function stepPhi(steps) {
  const n = D.phi.length;
  if (turning) state.phi = D.phi[(D.phi.indexOf(state.phi) + steps + n) % n]; else setPhi(state.phi + 5 * steps);
}
function stepTheta(steps) { state.theta = Math.max(0, Math.min(D.theta.length - 1, state.theta + steps)); }
function paintIncident() {
  const [g, w] = fit(hemisphere), c = w / 2, r = w / 2 - 8;
  const shade = g.createRadialGradient(c - .3 * r, c - .3 * r, .1 * r, c, c, r);
  shade.addColorStop(0, ink("ball-light")); shade.addColorStop(1, ink("ball"));
  g.fillStyle = shade; g.strokeStyle = ink("soft"); g.lineWidth = 1;
  g.beginPath(); g.arc(c, c, r, 0, 2 * Math.PI); g.fill(); g.stroke();
  g.strokeStyle = ink("line");
  for (const ring of [30, 60]) { g.beginPath(); g.arc(c, c, r * ring / 90, 0, 2 * Math.PI); g.stroke(); }
  for (const a of [0, 90]) { g.beginPath(); g.moveTo(c - r * Math.cos(a * RAD), c + r * Math.sin(a * RAD)); g.lineTo(c + r * Math.cos(a * RAD), c - r * Math.sin(a * RAD)); g.stroke(); }
  const [x, y] = turn(thetaI(), 0, state.phi), px = c + r * x / 90, py = c - r * y / 90;
  g.strokeStyle = ink("light"); g.lineWidth = 2;
  g.beginPath(); g.moveTo(px, py); g.lineTo(c, c); g.stroke();
  g.fillStyle = ink("light"); g.beginPath(); g.arc(px, py, 6, 0, 2 * Math.PI); g.fill();
  g.strokeStyle = ink("paper"); g.lineWidth = 1.5; g.stroke();
  hemisphere.setAttribute("aria-valuetext", `${thetaI()} degrees from the normal, azimuth ${state.phi} degrees`);
  hemisphere.setAttribute("aria-valuenow", String(thetaI()));
}
{
  let held = false;
  const at = event => {
    const box = hemisphere.getBoundingClientRect(), r = box.width / 2 - 8;
    aim((event.clientX - box.left - box.width / 2) / r * 90, -(event.clientY - box.top - box.height / 2) / r * 90);
  };
  hemisphere.addEventListener("pointerdown", event => {
    held = true;
    capture(hemisphere, event);
    at(event);
  });
  hemisphere.addEventListener("pointermove", event => { if (held) at(event); });
  for (const end of ["pointerup", "pointercancel"]) hemisphere.addEventListener(end, () => { held = false; });
}

// ---- Scale, section and curves.
function paintBar() {
  const [g, w] = fit(element("bar")), [low, high] = scale(D.models[0]);
  const x0 = 14, x1 = w - 14, y = 20, t = 14;
  g.font = "11" + FONT; g.fillStyle = ink("ink"); g.textBaseline = "middle"; g.textAlign = "left";
  g.fillText("DSF (1/sr)" + (state.locked ? "" : `, ${D.models[0].name}; the others differ`), x0, 8);
  g.textAlign = "right"; g.fillText("no data", x1 - 22, 8);
  g.fillStyle = "#cecece"; g.fillRect(x1 - 18, 2, 18, 12);
  g.save(); g.beginPath(); g.rect(x1 - 18, 2, 18, 12); g.clip(); g.strokeStyle = "#969696"; g.lineWidth = 1;
  for (let i = -12; i < 30; i += 5) { g.beginPath(); g.moveTo(x1 - 18 + i, 14); g.lineTo(x1 - 6 + i, 2); g.stroke(); }
  g.restore();
  for (let i = 0; i < 256; i++) {
    g.fillStyle = `rgb(${LUT[3 * i]},${LUT[3 * i + 1]},${LUT[3 * i + 2]})`;
    g.fillRect(x0 + (x1 - x0) * i / 256, y, (x1 - x0) / 256 + 1, t);
  }
  g.strokeStyle = ink("soft"); g.lineWidth = 1; g.strokeRect(x0, y, x1 - x0, t);
  g.textAlign = "center"; g.fillStyle = ink("ink");
  for (let e = Math.ceil(low); e <= high; e++) {
    const x = x0 + (x1 - x0) * (e - low) / (high - low);
    g.beginPath(); g.moveTo(x, y + t); g.lineTo(x, y + t + 4); g.stroke();
    power(g, e, x, y + t + 14);
  }
}
function power(g, e, x, y) {
  g.font = "11" + FONT; g.fillText("10", x - 3, y);
  g.font = "8" + FONT; g.fillText(exponent(e), x + 8, y - 5);
  g.font = "11" + FONT;
}
function frame(canvas, x0, x1, xStep, xLabel, y0, y1, ticks, yLabel) {
  const [g, w, h] = fit(canvas), left = 52, X = v => left + (w - left - 14) * (v - x0) / (x1 - x0), Y = v => h - 38 - (h - 66) * (v - y0) / (y1 - y0);
  g.font = "11" + FONT; g.lineWidth = 1; g.textBaseline = "middle";
  for (const { at, text, power: e } of ticks) {
    g.strokeStyle = ink("line"); g.beginPath(); g.moveTo(X(x0), Y(at)); g.lineTo(X(x1), Y(at)); g.stroke();
    g.fillStyle = ink("ink"); g.textAlign = "right";
    if (e === undefined) g.fillText(text, X(x0) - 6, Y(at)); else { g.textAlign = "center"; power(g, e, X(x0) - 20, Y(at) + 2); }
  }
  for (let a = x0; a <= x1; a += xStep) {
    g.strokeStyle = ink("line"); g.beginPath(); g.moveTo(X(a), Y(y0)); g.lineTo(X(a), Y(y1)); g.stroke();
    g.fillStyle = ink("ink"); g.textAlign = "center"; g.fillText(String(a).replace("-", "−"), X(a), Y(y0) + 12);
  }
  g.textAlign = "center"; g.fillStyle = ink("ink"); g.fillText(xLabel, X((x0 + x1) / 2), h - 9);
  g.save(); g.translate(9, Y((y0 + y1) / 2)); g.rotate(-Math.PI / 2); g.fillText(yLabel, 0, 0); g.restore();
  return { g, X, Y, w, h };
}
function legend(g, entries, x) {
  g.textAlign = "left"; g.textBaseline = "middle"; g.font = "11" + FONT;
  for (const [name, tint, dots] of entries) {
    g.strokeStyle = g.fillStyle = tint; g.lineWidth = 1.8; g.setLineDash([]);
    if (dots) { g.beginPath(); g.arc(x + 8, 10, 2, 0, 2 * Math.PI); g.fill(); } else { g.beginPath(); g.moveTo(x, 10); g.lineTo(x + 15, 10); g.stroke(); }
    g.fillStyle = ink("ink"); g.fillText(name, x + 20, 10);
    x += 36 + g.measureText(name).width;
  }
}
// Measured points of this side and incident direction.
const measuredHere = () => D.measured.filter(m => m.side === state.side && Math.abs(m.theta - thetaI()) < .05
  && (!turning || apart(m.phi, state.phi) < .5));
function paintSection() {
  const [low, high] = (() => { const was = state.locked; state.locked = true; const s = scale(D.models[0]); state.locked = was; return s; })();
  const ticks = [];
  for (let e = Math.ceil(low); e <= high; e++) ticks.push({ at: e, power: e });
  const { g, X, Y, w } = frame(element("section"), -90, 90, 30, "signed θₛ in the plane of incidence (°)", low, high, ticks, "DSF (1/sr)");
  const points = measuredHere();
  g.save();
  g.beginPath(); g.rect(X(-90), Y(high), X(90) - X(-90), Y(low) - Y(high)); g.clip();
  g.strokeStyle = ink("soft"); g.lineWidth = 1; g.setLineDash([2, 3]);
  g.beginPath(); g.moveTo(X(-thetaI()), Y(low)); g.lineTo(X(-thetaI()), Y(high)); g.stroke();
  g.setLineDash([]);
  let drawn = 0;
  g.fillStyle = onPaper(D.measuredColour); g.globalAlpha = .55;
  for (const table of points) for (const [a, v] of table.points) {
    if (!(v > 0)) continue;
    drawn++;
    g.beginPath(); g.arc(X(a), Y(Math.log10(v)), 1.3, 0, 2 * Math.PI); g.fill();
  }
  g.globalAlpha = 1;
  for (const { model } of panels) {
    const part = partOf(model);
    if (!part) continue;
    const { codes, errors } = numbers(part), first = start(model) + BASE + FINE, tint = onPaper(model.colour);
    const at = k => {
      const value = decode(part, codes[first + k]), error = errors ? decodeError(errors[first + k], value) : NaN, cosine = Math.cos(sectionAngle(k) * RAD);
      return [value * cosine, error * cosine];
    };
    if (errors) {
      g.fillStyle = tint; g.globalAlpha = .2;
      for (let k = 0; k < SECTION_N; k++) {
        const [v, e] = at(k);
        if (!(v > 0) || !(e > 0)) continue;
        const top = Y(Math.log10(v + 2 * e)), bottom = v > 2 * e ? Y(Math.log10(v - 2 * e)) : Y(low);
        g.fillRect(X(sectionAngle(k) - G.section / 2), top, X(G.section) - X(0) + .3, Math.max(.5, bottom - top));
      }
      g.globalAlpha = 1;
    }
    g.strokeStyle = tint; g.lineWidth = 1.4; g.beginPath();
    let pen = false;
    for (let k = 0; k < SECTION_N; k++) {
      const [v] = at(k);
      if (!(v > 0)) { pen = false; continue; }
      g[pen ? "lineTo" : "moveTo"](X(sectionAngle(k)), Y(Math.log10(v)));
      pen = true;
    }
    g.stroke();
  }
  g.restore();
  const canvas = element("section");
  canvas.dataset.measured = String(drawn);
  const shown = D.models.filter(partOf).map(m => [m.name, onPaper(m.colour)]);
  if (drawn) shown.push(["measured", onPaper(D.measuredColour), true]);
  legend(g, shown, X(-90));
  canvas.setAttribute("aria-label", `Section through the plane of incidence at ${thetaI()} degrees; ${drawn} measured points`);
}
function paintCurve() {
  const parts = D.models.map(m => [m, partOf(m)]).filter(([, p]) => p);
  const curve = (m, p) => p.curves[phiIndex(m)];
  const most = Math.max(0, ...parts.flatMap(([m, p]) => curve(m, p).map(c => Math.max(c[1], c[3] ?? 0))));
  const top = [0.05, 0.1, 0.2, 0.5, 1].find(v => v >= 1.02 * most) || 1.02 * most;
  const ticks = [0, 1, 2, 3, 4, 5].map(i => ({ at: top * i / 5, text: (top * i / 5).toFixed(top < 0.5 ? 2 : 1) }));
  const { g, X, Y } = frame(element("curve"), 0, 90, 15, "angle of incidence (°)", 0, top, ticks, `direct-hemispherical ${state.side.startsWith("t") ? "τ" : "ρ"}`);
  g.strokeStyle = ink("soft"); g.setLineDash([2, 3]);
  g.beginPath(); g.moveTo(X(thetaI()), Y(0)); g.lineTo(X(thetaI()), Y(top)); g.stroke();
  g.setLineDash([]);
  for (const [model, part] of parts) {
    const tint = onPaper(model.colour), rows = curve(model, part), banded = rows.filter(p => p[2] !== null);
    g.strokeStyle = g.fillStyle = tint;
    if (banded.length > 1) {
      g.globalAlpha = .2; g.beginPath();
      banded.forEach((p, i) => g[i ? "lineTo" : "moveTo"](X(p[0]), Y(p[3])));
      [...banded].reverse().forEach(p => g.lineTo(X(p[0]), Y(p[2])));
      g.closePath(); g.fill(); g.globalAlpha = 1;
    }
    const inside = part.last === null ? rows : rows.filter(p => p[0] <= part.last + 1e-9), beyond = rows.slice(Math.max(0, inside.length - 1));
    g.lineWidth = 1.8;
    for (const [points, dash] of [[inside, []], [beyond, [4, 3]]]) {
      if (points.length < 2) continue;
      g.setLineDash(dash); g.beginPath();
      points.forEach((p, i) => g[i ? "lineTo" : "moveTo"](X(p[0]), Y(p[1])));
      g.stroke();
    }
    g.setLineDash([]); g.lineWidth = 1;
    for (const [a, v, s] of part.knots.length <= 12 ? part.knots : []) {
      g.beginPath(); g.arc(X(a), Y(v), 2.6, 0, 2 * Math.PI); g.fill();
      g.beginPath(); g.moveTo(X(a), Y(v - 2 * s)); g.lineTo(X(a), Y(v + 2 * s)); g.stroke();
    }
  }
  legend(g, parts.map(([m]) => [m.name, onPaper(m.colour)]), X(0));
}

// ---- Switches.
const KIND = side => side.split("_")[0], FACE = side => side.split("_")[1];
function buttons(box, values, name, text, choose) {
  for (const value of values) {
    const button = make("button", "", element(box), text(value));
    button.type = "button"; button.dataset[name] = value;
    button.addEventListener("click", () => { choose(value); draw(); });
  }
}
const sideWith = (kind, face) => D.sides.find(s => s === `${kind}_${face}`);
function chooseKind(kind) { state.side = sideWith(kind, FACE(state.side)) || D.sides.find(s => KIND(s) === kind) || state.side; }
function chooseFace(face) { state.side = sideWith(KIND(state.side), face) || D.sides.find(s => FACE(s) === face) || state.side; }
buttons("kinds", ["transmission", "reflection"].filter(k => D.sides.some(s => KIND(s) === k)), "kind", v => v, chooseKind);
buttons("faces", ["front", "back"].filter(f => D.sides.some(s => FACE(s) === f)), "face", v => `light on the ${v}`, chooseFace);
if (D.bands.length) buttons("bands", D.bands, "band", v => v, band => { state.band = band; });
element("lock").addEventListener("click", () => { state.locked = !state.locked; draw(); });
const dark = () => (document.documentElement.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
function flip() { document.documentElement.dataset.theme = dark() ? "light" : "dark"; draw(); }
element("theme").addEventListener("click", flip);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw());
const theta = element("theta"), phi = element("phi");
theta.max = String(D.theta.length - 1);
phi.max = String(turning ? D.phi.length - 1 : 359);
theta.addEventListener("input", () => { state.theta = Number(theta.value); draw(); });
phi.addEventListener("input", () => { state.phi = turning ? D.phi[Number(phi.value)] : Number(phi.value); draw(); });
const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];
addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const inSlider = event.target instanceof HTMLInputElement, key = event.key;
  const does = {
    t: () => chooseKind(KIND(state.side) === "transmission" ? "reflection" : "transmission"),
    f: () => chooseFace(FACE(state.side) === "front" ? "back" : "front"),
    b: () => { if (D.bands.length) state.band = next(D.bands, state.band); },
    l: () => { state.locked = !state.locked; },
    d: flip,
    ...(inSlider ? {} : { ArrowUp: () => stepTheta(1), ArrowDown: () => stepTheta(-1), ArrowLeft: () => stepPhi(1), ArrowRight: () => stepPhi(-1) }),
  }[key.length === 1 ? key.toLowerCase() : key];
  // Arrow keys move the page unless the hemisphere has the focus.
  if (!does || (key.startsWith("Arrow") && event.target !== hemisphere)) return;
  event.preventDefault();
  does(); draw();
});

// Not shown, as in a page that is being printed: there is nothing to draw on.
const hidden = () => document.documentElement.clientWidth === 0;

function draw() {
  if (hidden()) return;
  inks = new Map();
  const begun = performance.now(), cells = mapCells();
  panels.forEach(p => { paintMap(p, cells); paintLobe(p); report(p); });
  paintIncident(); paintBar(); paintSection(); paintCurve();
  theta.value = String(state.theta);
  phi.value = String(turning ? D.phi.indexOf(state.phi) : state.phi);
  element("angle").textContent = `θᵢ = ${thetaI()}°`;
  element("azimuth").textContent = `φᵢ = ${state.phi}°`;
  theta.setAttribute("aria-valuetext", `${thetaI()} degrees`);
  phi.setAttribute("aria-valuetext", `${state.phi} degrees`);
  const press = (selector, test) => document.querySelectorAll(selector).forEach(b => b.setAttribute("aria-pressed", String(test(b.dataset))));
  press("[data-kind]", d => d.kind === KIND(state.side));
  press("[data-face]", d => d.face === FACE(state.side));
  press("[data-band]", d => d.band === state.band);
  for (const b of document.querySelectorAll("[data-face]")) b.disabled = !sideWith(KIND(state.side), b.dataset.face);
  element("lock").setAttribute("aria-pressed", String(state.locked));
  element("theme").setAttribute("aria-pressed", String(dark()));
  document.documentElement.dataset.drawMs = (performance.now() - begun).toFixed(1);
}
// Within a page of ours, which is light, so is the view unless it is told otherwise.
if (parent !== window) document.documentElement.dataset.theme = "light";
function fromAddress() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  if (D.sides.includes(wanted.get("side"))) state.side = wanted.get("side");
  if (D.bands.includes(wanted.get("band"))) state.band = wanted.get("band");
  if (wanted.has("theta")) {
    const t = Number(wanted.get("theta"));
    state.theta = D.theta.reduce((best, a, i) => Math.abs(a - t) < Math.abs(D.theta[best] - t) ? i : best, 0);
  }
  if (wanted.has("phi")) setPhi(Number(wanted.get("phi")));
  if (["light", "dark"].includes(wanted.get("theme"))) document.documentElement.dataset.theme = wanted.get("theme");
  if (wanted.has("x") && wanted.has("y")) {
    const at = [Number(wanted.get("x")), Number(wanted.get("y"))];
    state.at = Math.hypot(...at) < 90 ? at : null;
  }
}
fromAddress();
addEventListener("hashchange", () => { fromAddress(); draw(); });
// Inside another page, say how high this one is.
const tell = () => { if (parent !== window && !hidden()) parent.postMessage(document.querySelector("main").getBoundingClientRect().height + 34, "*"); };
addEventListener("resize", () => { draw(); tell(); });
draw();
tell();
document.documentElement.dataset.ready = "yes";
