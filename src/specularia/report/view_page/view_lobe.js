"use strict";
// ---- The lobe in space: radius is the logarithm of the DSF, five decades from the middle.
const AROUND = 60, OUT = 24, VERTICES = AROUND * OUT + 1;
function lobeMesh(model) {
  const part = partOf(model), [low, high] = scale(model), sign = state.side.startsWith("transmission") === state.side.endsWith("front") ? -1 : 1;
  const position = new Float32Array(3 * VERTICES), paint = new Float32Array(3 * VERTICES), good = new Uint8Array(VERTICES);
  const [cx, cy] = turn(-thetaI(), 0, state.phi), codes = numbers(part).codes, first = start(model), [hx, hy] = centreAt(model.isotropic ? 0 : state.phi);
  const c = model.isotropic ? Math.cos(state.phi * RAD) : 1, d = model.isotropic ? Math.sin(state.phi * RAD) : 0;
  const put = (k, x, y) => {
    const code = codes[first + indexAt(x * c + y * d, y * c - x * d, hx, hy)], r = Math.hypot(x, y), polar = r * RAD, cosine = Math.cos(polar);
    const level = code > 1 ? Math.max(0, Math.min(1, (part.low + (code - 2) * part.step + Math.log10(cosine) - low) / (high - low))) : 0;
    const s = r > 0 ? level * Math.sin(polar) / r : 0, i = 3 * Math.max(0, Math.min(255, Math.floor(level * 256)));
    position[3 * k] = s * x; position[3 * k + 1] = s * y; position[3 * k + 2] = sign * level * cosine;
    for (let m = 0; m < 3; m++) paint[3 * k + m] = LUT[i + m] / 255;
    good[k] = code === 0 ? 0 : 1;
  };
  put(0, cx, cy);
  for (let a = 0; a < AROUND; a++) {
    // From the undeflected direction out to the horizon, closer together near the former.
    const dx = Math.cos(2 * Math.PI * a / AROUND), dy = Math.sin(2 * Math.PI * a / AROUND), b = cx * dx + cy * dy;
    const far = -b + Math.sqrt(b * b + 89.5 * 89.5 - cx * cx - cy * cy);
    for (let k = 1; k <= OUT; k++) { const t = far * (k / OUT) ** 2; put(1 + a * OUT + k - 1, cx + t * dx, cy + t * dy); }
  }
  const faces = [];
  const add = (i, j, k) => { if (good[i] && good[j] && good[k]) faces.push(i, j, k); };
  for (let a = 0; a < AROUND; a++) {
    const b = (a + 1) % AROUND, first = 1 + a * OUT, other = 1 + b * OUT;
    add(0, first, other);
    for (let k = 0; k < OUT - 1; k++) { add(first + k, first + k + 1, other + k + 1); add(first + k, other + k + 1, other + k); }
  }
  return { position, paint, faces };
}
// Lines drawn with it: the pane, the scale's decades on it, the light that arrives, where it would leave.
function lobeLines() {
  const back = state.side.endsWith("back"), through = state.side.startsWith("transmission") !== back ? -1 : 1, t = thetaI() * RAD, p = state.phi * RAD;
  const from = [Math.sin(t) * Math.cos(p), Math.sin(t) * Math.sin(p), (back ? -1 : 1) * Math.cos(t)];
  const to = [-from[0], -from[1], through * Math.cos(t)], lines = [];
  for (let ring = 1; ring <= D.decades; ring++) {
    const r = ring / D.decades, points = [];
    for (let a = 0; a <= 72; a++) points.push([r * Math.cos(5 * a * RAD), r * Math.sin(5 * a * RAD), 0]);
    lines.push({ points, colour: ring === D.decades ? ink("soft") : ink("line") });
  }
  lines.push({ points: [[-1.08, 0, 0], [1.08, 0, 0]], colour: ink("line") }, { points: [[0, -1.08, 0], [0, 1.08, 0]], colour: ink("line") });
  lines.push({ points: [from.map(v => 1.2 * v), [0, 0, 0]], colour: ink("light") });
  lines.push({ points: [[0, 0, 0], to.map(v => 1.2 * v)], colour: CROSS });
  return lines;
}
const axes = () => {
  const a = state.az * RAD, e = state.el * RAD;
  const toEye = [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)], right = [Math.cos(a), 0, -Math.sin(a)];
  const up = [-Math.sin(a) * Math.sin(e), Math.cos(e), -Math.cos(a) * Math.sin(e)];
  return { toEye, right, up };
};
const REACH = 1.26;
// One renderer for each panel; null where this browser has no WebGL, and a painter's algorithm stands in.
// Browsers hold some 16 contexts at a time, so that a page of many models does without.
const graphics = new Map();
function renderer(canvas) {
  if (graphics.has(canvas)) return graphics.get(canvas);
  let made = null;
  const off = new URLSearchParams(location.hash.slice(1)).get("webgl") === "off" || panels.length > 8;
  const context = off ? null : canvas.getContext("webgl2", { alpha: true, antialias: true });
  if (context) {
    THREE.ColorManagement.enabled = false;
    const engine = new THREE.WebGLRenderer({ canvas, context, alpha: true, antialias: true });
    engine.outputColorSpace = THREE.LinearSRGBColorSpace;
    engine.setClearColor(0, 0);
    // All is kept from one drawing to the next: shaders are slow to make.
    const geometry = new THREE.BufferGeometry(), scene = new THREE.Scene(), lamp = new THREE.DirectionalLight(0xffffff, 1.4);
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * VERTICES), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * VERTICES), 3));
    const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
    mesh.frustumCulled = false;
    scene.add(mesh, new THREE.AmbientLight(0xffffff, 2.1), lamp);
    const lines = lobeLines().map(line => {
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * line.points.length), 3));
      const drawn = new THREE.Line(shape, new THREE.LineBasicMaterial());
      drawn.frustumCulled = false;
      scene.add(drawn);
      return drawn;
    });
    made = { engine, scene, geometry, lamp, lines, camera: new THREE.OrthographicCamera(-REACH, REACH, REACH, -REACH, .1, 10) };
  }
  graphics.set(canvas, made);
  return made;
}
function paintLobe(panel) {
  const part = partOf(panel.model);
  const mesh = part ? lobeMesh(panel.model) : { position: new Float32Array(3), paint: new Float32Array(3), faces: [] };
  const gl = renderer(panel.lobe);
  document.documentElement.dataset.lobe = gl ? "webgl" : "canvas";
  panel.lobe.dataset.faces = String(mesh.faces.length / 3);
  if (gl) lobeByThree(gl, panel.lobe, mesh); else lobeByHand(...fit(panel.lobe), mesh);
}
function lobeByThree(gl, canvas, mesh) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect(), w = Math.max(1, Math.round(box.width * ratio)), h = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== w || canvas.height !== h) gl.engine.setSize(w, h, false);
  const { toEye, right, up } = axes();
  for (const [name, values] of [["position", mesh.position], ["color", mesh.paint]]) {
    const held = gl.geometry.getAttribute(name);
    held.array.fill(0); held.array.set(values); held.needsUpdate = true;
  }
  gl.geometry.setIndex(mesh.faces);
  gl.geometry.computeVertexNormals();
  lobeLines().forEach((line, i) => {
    const held = gl.lines[i].geometry.getAttribute("position");
    line.points.forEach((p, k) => held.setXYZ(k, ...p));
    held.needsUpdate = true;
    gl.lines[i].material.color.set(line.colour);
  });
  gl.lamp.position.set(...toEye.map((v, i) => v + .5 * up[i] - .4 * right[i]));
  const aspect = w / h;
  Object.assign(gl.camera, { left: -REACH * aspect, right: REACH * aspect });
  gl.camera.position.set(...toEye.map(v => 4 * v));
  gl.camera.up.set(...up);
  gl.camera.lookAt(0, 0, 0);
  gl.camera.updateProjectionMatrix();
  gl.engine.render(gl.scene, gl.camera);
}
function lobeByHand(g, w, h, mesh) {
  const { toEye, right, up } = axes(), unit = h / 2 / REACH, dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const n = mesh.position.length / 3, X = new Float32Array(n), Y = new Float32Array(n), Z = new Float32Array(n);
  const at = k => [mesh.position[3 * k], mesh.position[3 * k + 1], mesh.position[3 * k + 2]];
  for (let k = 0; k < n; k++) { const p = at(k); X[k] = w / 2 + unit * dot(p, right); Y[k] = h / 2 - unit * dot(p, up); Z[k] = dot(p, toEye); }
  for (const line of lobeLines()) {
    g.strokeStyle = line.colour; g.lineWidth = 1; g.beginPath();
    line.points.forEach((p, i) => g[i ? "lineTo" : "moveTo"](w / 2 + unit * dot(p, right), h / 2 - unit * dot(p, up)));
    g.stroke();
  }
  const faces = mesh.faces, count = faces.length / 3, depth = new Float32Array(count), P = mesh.position, paint = mesh.paint;
  for (let f = 0; f < count; f++) depth[f] = Z[faces[3 * f]] + Z[faces[3 * f + 1]] + Z[faces[3 * f + 2]];
  const order = Uint32Array.from(depth.keys()).sort((a, b) => depth[a] - depth[b]);
  g.lineWidth = .6;
  for (const f of order) {
    const i = faces[3 * f], j = faces[3 * f + 1], k = faces[3 * f + 2];
    const ux = P[3 * j] - P[3 * i], uy = P[3 * j + 1] - P[3 * i + 1], uz = P[3 * j + 2] - P[3 * i + 2];
    const vx = P[3 * k] - P[3 * i], vy = P[3 * k + 1] - P[3 * i + 1], vz = P[3 * k + 2] - P[3 * i + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx, length = Math.hypot(nx, ny, nz);
    if (!length) continue;
    const shade = 85 * (.65 + .35 * Math.abs(nx * toEye[0] + ny * toEye[1] + nz * toEye[2]) / length);
    const tone = m => Math.round(shade * (paint[3 * i + m] + paint[3 * j + m] + paint[3 * k + m]));
    g.fillStyle = g.strokeStyle = `rgb(${tone(0)},${tone(1)},${tone(2)})`;
    g.beginPath(); g.moveTo(X[i], Y[i]); g.lineTo(X[j], Y[j]); g.lineTo(X[k], Y[k]); g.closePath(); g.fill(); g.stroke();
  }
}
