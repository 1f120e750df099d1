"use strict";
// A page in which a mechanism runs: the model in WebAssembly, its picture, and what moves both. DATA stands in the page.

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
const CLOSED = 1e-9; // scaled residual of loops that count as closed
const DECLARED = "as declared"; // of an input, whatever the model has

// -- the model ------------------------------------------------------------------------------------------------------------

class Model {
  static async open(info, text) {
    const { instance } = await WebAssembly.instantiate(bytesOf(text), {});
    return new Model(info, instance.exports);
  }

  constructor(info, exports) {
    this.info = info;
    this.f = exports;
    if (exports._initialize) exports._initialize();
    const { events, resets } = info;
    const column = (rows, k) => this.integers(rows.map((row) => row[k]));
    exports.web_open(
      info.q.length, info.slots.length, this.integers(info.slots.flat()), events.length, column(events, 1),
      column(events, 2), column(events, 3), resets.length, column(resets, 0), column(resets, 1),
    );
    const n = info.x.length;
    this.n = n;
    this.spare = { x: this.room(3 * n + 64), p: this.room(info.p.length), mask: exports.web_room(4 * n + 16) };
    this.kernels = {};
    for (let k = 0; k < exports.web_count(); k += 1) {
      const size = exports.web_length(k);
      this.kernels[this.text(exports.web_name(k))] = [k, size, this.room(size)];
    }
    this.operations = [];
    const names = new Int32Array(exports.memory.buffer, exports.web_operations(), 400);
    for (let k = 0; names[k] !== 0; k += 1) this.operations.push(this.text(names[k]));
    this.setParameters(info.pValues);
    exports.web_scales();
    this.inputs = [];
    info.u.forEach((_, k) => this.setInput(k, DECLARED));
    this.atol = this.room(n);
    this.write(this.atol, info.atol);
  }

  room(count) { return this.f.web_room(8 * Math.max(count, 1)); }
  write(at, values) { new Float64Array(this.f.memory.buffer, at, values.length).set(values); }
  read(at, count) { return new Float64Array(this.f.memory.buffer, at, count).slice(); }

  integers(values) {
    const at = this.f.web_room(4 * values.length + 4);
    new Int32Array(this.f.memory.buffer, at, values.length).set(values);
    return at;
  }

  text(at) {
    const bytes = new Uint8Array(this.f.memory.buffer);
    let end = at;
    while (bytes[end] !== 0) end += 1;
    return String.fromCharCode(...bytes.subarray(at, end));
  }

  setParameters(p) {
    this.p = [...p];
    this.write(this.spare.p, p);
    return this.f.web_set(this.spare.p) === 0;
  }

  // An input: a number, an expression, or as the model declares it.
  setInput(k, given) {
    const { info } = this, known = info.signals[k], value = given === DECLARED && !known ? info.uValues[k] : given;
    if (typeof value !== "number") this.setTape(k, ...(value === DECLARED ? known.slice(1) : parseExpression(value, info)));
    else {
      this.f.web_signal(k, 0, 0, 0, 0);
      new Float64Array(this.f.memory.buffer, this.f.web_inputs(), info.u.length)[k] = value;
    }
    this.inputs[k] = value;
  }

  setTape(k, code, constants, last) {
    const rows = code.flatMap(([name, a, b, c]) => [this.operations.indexOf(name), a, b, c]);
    const numbers = this.room(constants.length);
    this.write(numbers, constants);
    this.f.web_signal(k, code.length, this.integers(rows), numbers, last);
  }

  // Values of a function of the model at a time and a state; null where it has none.
  call(name, t, x) {
    if (!(name in this.kernels)) return null;
    const [k, size, out] = this.kernels[name];
    this.write(this.spare.x, x);
    this.f.web_force(t, this.spare.x);
    return this.f.web_call(k, t, this.spare.x, out) === 0 ? this.read(out, size) : null;
  }

  mask(held) {
    new Int32Array(this.f.memory.buffer, this.spare.mask, this.n).set(this.info.v.map((_, k) => +held.includes(k)));
    return this.spare.mask;
  }

  // The state with loops closed near x, where velocities that are held keep coordinates and values; null if there is none.
  close(t, x, held) {
    this.write(this.spare.x, x);
    const mask = this.mask(held);
    if (!(this.f.web_close(t, this.spare.x, mask) <= CLOSED)) return null;
    const beyond = this.f.web_close_rates(t, this.spare.x, mask);
    const found = this.read(this.spare.x, this.n);
    const aligned = this.call("alignment", t, found);
    if (aligned && aligned.some((part) => part <= 0)) return null;
    return beyond <= 1e-7 ? found : this.call("project", t, found);
  }

  // From a closed state to other parameters and coordinates, in steps that stay on its branch: [state, parameters, whether
  // they are reached].
  reach(t, from, p, values) {
    const { info } = this, first = this.p, held = info.independent;
    let far = 0, x = from, last = first;
    if (![...p, ...values.map(([, value]) => value)].every(Number.isFinite)) return [x, last, false];
    p.forEach((value, k) => { far = Math.max(far, Math.abs(value - first[k]) / (Math.abs(first[k]) || 1)); });
    for (const [k, value] of values) far = Math.max(far, Math.abs(value - from[k]) / (k < info.q.length ? info.sizes[k] : 1e9));
    const count = info.rows ? Math.min(60, Math.max(1, Math.ceil(far / 0.05))) : 1;
    for (let step = 1; step <= count; step += 1) {
      const part = step === count ? 1 : step / count, next = Float64Array.from(x);
      const between = (a, b) => (part === 1 ? b : a + part * (b - a));
      for (const [k, value] of values) next[k] = between(from[k], value);
      const here = p.map((value, k) => between(first[k], value));
      const closed = this.setParameters(here) ? (info.rows ? this.close(t, next, held) : next) : null;
      if (!closed || !closed.every(Number.isFinite)) {
        this.setParameters(last);
        return [x, last, false];
      }
      x = closed;
      last = here;
    }
    return [x, last, true];
  }

  // Bring a point of a body towards a place seen along axes; null where loops would open.
  pull(t, x, body, local, axes, target, size) {
    const at = this.spare.x + 8 * this.n, put = [...local, ...axes, ...target];
    let now = x;
    for (let k = 0; k < 4; k += 1) {
      this.write(this.spare.x, now);
      this.write(at, put);
      const count = target.length, mask = this.mask([]);
      if (this.f.web_pull(t, this.spare.x, mask, body, at, at + 24, count, at + 24 + 8 * axes.length, size)) return null;
      if (this.info.rows && !(this.f.web_close(t, this.spare.x, mask) <= CLOSED)) return null;
      now = this.read(this.spare.x, this.n);
    }
    return this.info.rows ? this.close(t, now, this.info.independent) : now;
  }

  begin(t, x) {
    const { info } = this;
    this.write(this.spare.x, x);
    this.f.web_begin(t, this.spare.x, info.rtol, this.atol, info.maxStep ?? Infinity, info.firstStep ?? 0, info.end);
    this.ended = "";
    this.happened = [];
  }

  // Steps up to a time, for some milliseconds at most; whether it is reached.
  advance(target, most = Infinity) {
    const begun = performance.now();
    while (!this.ended) {
      const status = this.f.web_advance(target, 8), width = 2 + this.n;
      for (let k = 0; k < this.f.web_noted(); k += 1) {
        const [event, t] = this.read(this.f.web_notes() + 8 * width * k, 2);
        this.happened.push([this.info.events[event][0], t]);
      }
      if (status === 1) return true;
      if (status !== 0) this.ended = this.why(status / 10);
      if (performance.now() - begun > most) return false;
    }
    return false;
  }

  why(status) {
    const t = this.f.web_time().toPrecision(5);
    if (status === 2) return `an event ended the run at t = ${t} s`;
    if (status === -102) return `events follow each other ever faster at t = ${t} s`;
    if (status === -103) return `the state after an event at t = ${t} s cannot be closed`;
    const reasons = ["its steps became too small", "a value is not finite", "the mass matrix is singular",
      "the loops cannot be closed", "the independent coordinates cannot move the mechanism here",
      "the accelerations are not determined"];
    return `the run ends at t = ${t} s: ${reasons[this.f.web_failure()] ?? reasons[0]}`;
  }

  // The state at a time of the last step, on the constraints.
  state(t) {
    this.f.web_state(t, this.spare.x);
    const x = this.read(this.spare.x, this.n);
    return this.call("project", t, x) ?? x;
  }

  residual(t, x) {
    const rows = this.call("constraints", t, x);
    return rows ? rows.reduce((most, row) => Math.max(most, Math.abs(row)), 0) : 0;
  }
}

// -- inputs as expressions of t -------------------------------------------------------------------------------------------

const FUNCTIONS = { min: 2, max: 2, atan2: 2, hypot: 2 }; // numbers that each takes, the first two or more
for (const name of "abs sign sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh".split(" ")) FUNCTIONS[name] = 1;

// The instructions of a text such as 2*sin(3*t): [code, numbers, last], as the model plays them.
function parseExpression(text, names) {
  const code = [], numbers = [], words = text.match(/\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?|\w+|\*\*|\S/gi) ?? [];
  let at = 0;
  const emit = (name, a = 0, b = 0, c = 0) => code.push([name, a, b, c]) - 1;
  const number = (value) => emit("const", numbers.push(value) - 1);
  const take = (word) => words[at] === word && (at += 1);
  const need = (word) => { if (!take(word)) throw new Error(`${word} is missing in ${text}`); };
  function atom() {
    const word = words[at];
    at += 1;
    if (word === "(") { const inside = sum(); need(")"); return inside; }
    if (Number.isFinite(Number(word))) return number(Number(word));
    if (word === "t") return emit("t");
    if (word === "pi") return number(Math.PI);
    for (const kind of ["x", "p"]) if (names[kind].includes(word)) return emit(kind, names[kind].indexOf(word));
    if (!Object.hasOwn(FUNCTIONS, word) || words[at] !== "(") throw new Error(`${word ?? "the end"} is not known in ${text}`);
    at += 1;
    const given = [sum()];
    while (take(",")) given.push(sum());
    need(")");
    const count = FUNCTIONS[word], most = ["min", "max"].includes(word) ? Infinity : count;
    if (given.length < count || given.length > most) throw new Error(`${word}() takes ${count}${most > count ? " or more" : ""}, not ${given.length} in ${text}`);
    return most > count ? given.reduce((a, b) => emit(word, a, b)) : emit(word, ...given);
  }
  function power() {
    const base = atom();
    return take("**") ? emit("pow", base, unary()) : base;
  }
  function unary() { return take("-") ? emit("neg", unary()) : (take("+"), power()); }
  function chain(part, signs) {
    let found = part();
    for (let sign = words[at]; Object.hasOwn(signs, sign); sign = words[at]) { at += 1; found = emit(signs[sign], found, part()); }
    return found;
  }
  function product() { return chain(unary, { "*": "mul", "/": "div" }); }
  function sum() { return chain(product, { "+": "add", "-": "sub" }); }
  const last = sum();
  if (at < words.length) throw new Error(`${words[at]} is not expected in ${text}`);
  return [code, numbers, last];
}

// -- vectors --------------------------------------------------------------------------------------------------------------

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const scaled = (a, s) => [s * a[0], s * a[1], s * a[2]];
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
const turn = (m, v) => [0, 4, 8].map((r) => m[r] * v[0] + m[r + 1] * v[1] + m[r + 2] * v[2]); // a row-major 4 x 4 pose
const place = (m, v) => plus(turn(m, v), [m[3], m[7], m[11]]);
const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

// Two unit vectors across a direction, the first on the page of a planar mechanism.
function acrossOf(along, view) {
  const least = along.map(Math.abs).indexOf(Math.min(...along.map(Math.abs)));
  let other = view ? view[2] : [0, 1, 2].map((k) => +(k === least));
  if (Math.hypot(...cross(other, along)) < 1e-9) other = view ? view[0] : [1, 0, 0];
  const across = unit(cross(other, along));
  return [across, cross(along, across)];
}

// Points where a taut string from a to b lies on a cylinder; on the straight line if it does not touch.
function wound(pose, { rotation, radius: r, sense }, center, a, b) {
  const columns = [0, 1, 2].map((k) => turn(pose, [rotation[0][k], rotation[1][k], rotation[2][k]]));
  const local = (point) => columns.map((column) => dot(column, plus(point, center, -1)));
  const [p, q] = [local(a), local(b)], far = [p, q].map((one) => Math.hypot(one[0], one[1])), count = 25;
  const parts = Array.from({ length: count }, (_, k) => k / (count - 1));
  const straight = parts.map((s) => plus(a, plus(b, a, -1), s));
  if (Math.min(...far) <= r) return straight;
  const begin = Math.atan2(p[1], p[0]) + sense * Math.acos(r / far[0]), whole = 2 * Math.PI;
  const angle = (((sense * (Math.atan2(q[1], q[0]) - sense * Math.acos(r / far[1]) - begin)) % whole) + whole) % whole;
  const ways = [Math.sqrt(far[0] ** 2 - r * r), r * angle, Math.sqrt(far[1] ** 2 - r * r)], direct = [q[0] - p[0], q[1] - p[1]];
  const side = p[0] * q[1] - p[1] * q[0], ahead = p[0] * direct[0] + p[1] * direct[1] < 0 && q[0] * direct[0] + q[1] * direct[1] > 0;
  const touches = ahead && Math.abs(side) / Math.hypot(...direct) < r;
  if (angle > Math.PI && !touches) return straight;
  const sum = ways[0] + ways[1] + ways[2];
  return parts.map((s) => {
    const phi = begin + sense * angle * s, z = p[2] + ((q[2] - p[2]) * (ways[0] + ways[1] * s)) / sum;
    return [0, 1, 2].reduce((at, k) => plus(at, columns[k], [r * Math.cos(phi), r * Math.sin(phi), z][k]), center);
  });
}

// -- the picture ----------------------------------------------------------------------------------------------------------

// WebGL 2, because planes and solids of a few thousand faces then take a fraction of a frame on a telephone too.
const MESH = [`#version 300 es
in vec3 point; uniform mat4 pose, camera; out vec3 world;
void main() { vec4 at = pose * vec4(point, 1.0); world = at.xyz; gl_Position = camera * at; }`,
`#version 300 es
precision highp float; in vec3 world; uniform vec4 color; uniform vec3 light; uniform float lit; out vec4 seen;
void main() { float side = abs(dot(normalize(cross(dFdx(world), dFdy(world))), light));
  seen = vec4(color.rgb * mix(1.0, 0.55 + 0.5 * side, lit), color.a); }`];
const LINE = [`#version 300 es
in vec2 corner; in vec3 from, to; uniform mat4 pose, camera; uniform vec2 size; uniform float wide;
void main() { vec4 a = camera * (pose * vec4(from, 1.0)), b = camera * (pose * vec4(to, 1.0));
  vec2 way = (b.xy / b.w - a.xy / a.w) * size; float far = length(way); way = far > 0.0 ? way / far : vec2(1.0, 0.0);
  vec4 at = mix(a, b, corner.x); at.xy += (corner.y * vec2(-way.y, way.x) + (2.0 * corner.x - 1.0) * way) * wide / size * at.w;
  at.z -= 1e-4 * at.w; gl_Position = at; }`,
`#version 300 es
precision highp float; uniform vec4 color; out vec4 seen; void main() { seen = color; }`];

class Picture {
  constructor(data, numbers, canvas, over) {
    this.data = data;
    this.numbers = numbers;
    this.canvas = canvas;
    this.pen = over.getContext("2d");
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    this.gl = gl;
    if (!gl) return;
    this.programs = [MESH, LINE].map((texts) => this.program(texts));
    this.corner = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corner);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]), gl.STATIC_DRAW);
    this.shapes = data.shapes.map(([at, count]) => numbers.slice(at, at + count));
    this.items = data.items.map((item) => ({ ...item, buffer: gl.createBuffer(), faceBuffer: gl.createBuffer() }));
    this.items.sort((a, b) => a.layer - b.layer);
    for (const item of this.items.filter((one) => one.faces)) {
      const [at, count] = item.faces;
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, item.faceBuffer);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from(numbers.subarray(at, at + count)), gl.STATIC_DRAW);
    }
    this.trace = { points: [], buffer: gl.createBuffer(), kind: "line", color: "#999999", alpha: 1, width: 1.2, body: -1 };
    this.floor = this.grid();
    [this.low, this.high] = [data.low, data.high];
    this.fit();
    this.change({});
  }

  program(texts) {
    const { gl } = this, made = gl.createProgram();
    texts.forEach((text, k) => {
      const shader = gl.createShader([gl.VERTEX_SHADER, gl.FRAGMENT_SHADER][k]);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    });
    gl.linkProgram(made);
    const names = ["pose", "camera", "color", "light", "lit", "size", "wide"];
    return { made, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)])) };
  }

  // Shapes at values of parameters: each moves along with those that it depends on.
  change(values) {
    const { data, numbers } = this;
    this.points = this.shapes.map((shape) => shape);
    for (const { name, at, low, high, moved } of data.morphs) {
      const value = values[name] ?? at, below = value < at, end = below ? low : high;
      if (value === at || end === at) continue;
      const part = (value - at) / (end - at);
      for (const [shape, ...places] of moved) {
        const [first, count] = places[below ? 0 : 1];
        const changed = this.points[shape] === this.shapes[shape] ? this.shapes[shape].slice() : this.points[shape];
        for (let k = 0; k < count; k += 1) changed[k] += part * numbers[first + k];
        this.points[shape] = changed;
      }
    }
    for (const item of this.items) if (!item.follow && !item.frames) this.load(item, this.points[item.shape]);
  }

  // The points of an item into its buffer; of a line, its segments.
  load(item, points) {
    const { gl } = this;
    let data = points;
    if (!item.faces) {
      data = [];
      for (let k = 0; k + 5 < points.length; k += 3) {
        const pair = points.slice(k, k + 6);
        if (!pair.some(Number.isNaN)) data.push(...pair);
      }
    }
    item.count = data.length;
    item.drawn = points;
    gl.bindBuffer(gl.ARRAY_BUFFER, item.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data instanceof Float32Array ? data : Float32Array.from(data), gl.DYNAMIC_DRAW);
  }

  // Points in ground axes of what is fixed to no body.
  followed(item, poses) {
    const points = this.points[item.shape], { view } = this.data;
    const row = (k) => [points[3 * k], points[3 * k + 1], points[3 * k + 2]];
    const stops = item.stops.map((stop, k) => place(poses[stop.body], row(k)));
    const rest = Array.from({ length: points.length / 3 - stops.length }, (_, k) => row(k + stops.length));
    if (item.follow === "Shifted") return rest.flatMap((point) => plus(stops[0], point));
    if (item.follow === "Stretched") {
      const way = plus(stops[1], stops[0], -1), long = Math.hypot(...way), [stop] = item.stops;
      const axis = [stop.rotation[0][2], stop.rotation[1][2], stop.rotation[2][2]];
      const [across, other] = acrossOf(long > 0 ? scaled(way, 1 / long) : turn(poses[stop.body], axis), item.flat ? view : null);
      return rest.flatMap(([s, x, y]) => plus(plus(plus(stops[0], way, s), across, x), other, y));
    }
    const found = [stops[0]];
    for (let k = 1; k < stops.length; k += 1) {
      const stop = item.stops[k];
      if (!stop.radius || k + 1 === stops.length) found.push(stops[k]);
      else found.push(...wound(poses[stop.body], stop, stops[k], stops[k - 1], stops[k + 1]));
    }
    return found.flat();
  }

  // -- camera --

  // The box that the items fill at several poses, with an edge, in axes of the view.
  extent(several) {
    const { view } = this.data, low = [Infinity, Infinity, Infinity], high = low.map((x) => -x);
    for (const { drawn = [], body, follow, frames } of this.items) {
      for (const poses of follow || frames || body < 0 ? [[]] : several) {
        for (let k = 0; k + 2 < drawn.length; k += 3) {
          const at = place(poses[body] ?? IDENTITY, drawn.slice(k, k + 3)), seen = view ? view.map((axis) => dot(axis, at)) : at;
          if (!seen.some(Number.isNaN)) seen.forEach((x, i) => { low[i] = Math.min(low[i], x); high[i] = Math.max(high[i], x); });
        }
      }
    }
    const edge = 0.07 * Math.max(...high.map((x, i) => x - low[i]));
    return { low: low.map((x) => x - edge), high: high.map((x) => x + edge) };
  }

  fit() {
    const { view, up } = this.data, { low, high } = this, middle = low.map((x, k) => 0.5 * (x + high[k]));
    this.target = view ? [0, 1, 2].map((k) => middle[0] * view[0][k] + middle[1] * view[1][k] + middle[2] * view[2][k]) : middle;
    this.zoom = 1;
    this.free = 0;
    const side = Math.abs(up[0]) > 0.5 ? [0, 1, 0] : [1, 0, 0];
    const depth = unit(cross(side, up));
    this.toward = view ? view[2] : unit(plus(plus(scaled(depth, 0.75), cross(up, depth), 0.45), up, 0.4));
    this.up = view ? view[1] : up;
  }

  look() {
    const { data, canvas } = this, wide = canvas.clientWidth || 1, tall = canvas.clientHeight || 1;
    const size = this.high.map((x, k) => x - this.low[k]), right = unit(cross(this.up, this.toward));
    const up = cross(this.toward, right), span = Math.hypot(...size);
    const half = data.view ? 0.53 * Math.max(size[1], (size[0] * tall) / wide) : 0.46 * span * Math.max(1, 0.9 * tall / wide);
    this.half = half / this.zoom; // half of what is seen upwards at the target
    const far = 4 * this.half + span, near = data.view ? 0 : 3.2 * this.half, aspect = tall / wide, h = this.half;
    const eye = plus(this.target, this.toward, data.view ? 0 : near);
    const rows = [scaled(right, aspect / h), scaled(up, 1 / h), scaled(this.toward, -1 / far)];
    const w = data.view ? [0, 0, 0, 1] : [...scaled(this.toward, -1 / near), dot(this.toward, eye) / near];
    const m = rows.map((row) => [...row, -dot(row, this.target)]);
    if (!data.view) { // depth between 0.02 and far of the eye, as a fraction
      const close = 0.02 * near, end = near + 2 * span, a = (end + close) / (end - close), b = (2 * end * close) / (end - close);
      m[2] = w.map((x, k) => a * x - (k === 3 ? b / near : 0));
    }
    this.axes = { right, up };
    this.matrix = new Float32Array(16);
    for (let k = 0; k < 4; k += 1) [m[0][k], m[1][k], m[2][k], w[k]].forEach((x, r) => { this.matrix[4 * k + r] = x; });
  }

  // Where a point is seen: dots from the left and from the top, and how far away.
  seen(point) {
    const m = this.matrix, at = [0, 1, 2, 3].map((r) => m[r] * point[0] + m[4 + r] * point[1] + m[8 + r] * point[2] + m[12 + r]);
    return [(0.5 + (0.5 * at[0]) / at[3]) * this.canvas.clientWidth, (0.5 - (0.5 * at[1]) / at[3]) * this.canvas.clientHeight, at[2] / at[3], at[3]];
  }

  // The body under a dot, and the point of it that is nearest to the reader.
  pick(x, y) {
    let best = null;
    for (const item of this.items) {
      if (!item.faces || item.body < 0 || item.follow) continue;
      const pose = this.poses[item.body], points = item.drawn, seen = [], [at, count] = item.faces;
      for (let k = 0; k < points.length; k += 3) seen.push(this.seen(place(pose, points.subarray(k, k + 3))));
      for (let k = at; k < at + count; k += 3) {
        const [a, b, c] = [0, 1, 2].map((j) => this.numbers[k + j]), [p, q, r] = [seen[a], seen[b], seen[c]];
        const area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        const s = ((x - p[0]) * (r[1] - p[1]) - (y - p[1]) * (r[0] - p[0])) / area;
        const u = ((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])) / area;
        if (!(s >= 0 && u >= 0 && s + u <= 1)) continue;
        const depth = this.data.view ? -item.layer : p[2] + s * (q[2] - p[2]) + u * (r[2] - p[2]);
        if (best && depth > best.depth) continue;
        const corner = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
        const local = plus(plus(corner(a), plus(corner(b), corner(a), -1), s), plus(corner(c), corner(a), -1), u);
        best = { body: item.body, local, depth };
      }
    }
    return best;
  }

  // -- drawing --

  grid() {
    const { view, low, high, up } = this.data;
    if (view) return null;
    const k = up.map(Math.abs).indexOf(Math.max(...up.map(Math.abs))), [i, j] = [0, 1, 2].filter((axis) => axis !== k);
    const reach = Math.max(high[i] - low[i], high[j] - low[j]), step = 10 ** Math.floor(Math.log10(reach / 2)) / 2 || 1;
    const ends = [i, j].map((axis) => [Math.floor(low[axis] / step), Math.ceil(high[axis] / step)]), points = [];
    const put = (a, b) => { const point = [0, 0, 0]; point[i] = a * step; point[j] = b * step; point[k] = up[k] > 0 ? low[k] : high[k]; points.push(...point); };
    const many = Math.ceil(Math.max(ends[0][1] - ends[0][0], ends[1][1] - ends[1][0]) / 24);
    for (let a = ends[0][0]; a <= ends[0][1]; a += many) { put(a, ends[1][0]); put(a, ends[1][1]); points.push(NaN, NaN, NaN); }
    for (let b = ends[1][0]; b <= ends[1][1]; b += many) { put(ends[0][0], b); put(ends[0][1], b); points.push(NaN, NaN, NaN); }
    const item = { buffer: this.gl.createBuffer(), color: "#888888", alpha: 0.35, width: 1, body: -1 };
    this.load(item, Float32Array.from(points));
    return item;
  }

  colored(color, alpha, dark, paper) {
    let rgb = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16) / 255);
    const grey = Math.max(...rgb) - Math.min(...rgb) < 0.06 && (this.data.view || rgb[0] < 0.6);
    if (dark && grey) rgb = rgb.map((x) => 0.95 - 0.85 * x);
    if (this.data.view) return [...rgb.map((x, k) => alpha * x + (1 - alpha) * paper[k]), 1];
    return [...rgb, alpha];
  }

  draw(poses, frame, dark, names) {
    const { gl, canvas, data } = this, ratio = window.devicePixelRatio || 1;
    const wide = Math.round(canvas.clientWidth * ratio), tall = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== tall) { canvas.width = this.pen.canvas.width = wide; canvas.height = this.pen.canvas.height = tall; }
    this.poses = poses;
    this.look();
    const paper = dark ? [0.09, 0.1, 0.12] : [1, 1, 1];
    gl.viewport(0, 0, wide, tall);
    gl.clearColor(...paper, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    (data.view ? gl.disable : gl.enable).call(gl, gl.DEPTH_TEST);
    const list = [...(this.floor ? [this.floor] : []), ...this.items];
    if (this.trace.points.length > 3) { this.load(this.trace, this.trace.points); list.push(this.trace); }
    if (!data.view) list.sort((a, b) => b.alpha - a.alpha);
    for (const item of list) {
      if (item.frames) this.load(item, this.numbers.subarray(item.frames + frame * item.size, item.frames + (frame + 1) * item.size));
      else if (item.follow) this.load(item, Float32Array.from(this.followed(item, poses)));
      if (item.count) this.drawItem(item, poses, [wide, tall], ratio, this.colored(item.color, item.alpha, dark, paper));
    }
    this.label(poses, ratio, dark, names);
  }

  drawItem(item, poses, size, ratio, color) {
    const { gl } = this, { made, at } = this.programs[item.faces ? 0 : 1];
    const pose = item.follow || item.frames ? IDENTITY : poses[item.body] ?? IDENTITY;
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.pose, true, pose);
    gl.uniformMatrix4fv(at.camera, false, this.matrix);
    gl.uniform4f(at.color, ...color);
    (color[3] < 1 ? gl.enable : gl.disable).call(gl, gl.BLEND);
    gl.depthMask(color[3] === 1);
    const bind = (name, buffer, count, stride, offset, each) => {
      const place_ = gl.getAttribLocation(made, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(place_);
      gl.vertexAttribPointer(place_, count, gl.FLOAT, false, stride, offset);
      gl.vertexAttribDivisor(place_, each);
    };
    if (item.faces) {
      gl.uniform3f(at.light, ...unit(plus(this.toward, this.up, 0.6)));
      gl.uniform1f(at.lit, this.data.view ? 0 : 1);
      bind("point", item.buffer, 3, 0, 0, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, item.faceBuffer);
      gl.drawElements(gl.TRIANGLES, item.faces[1], gl.UNSIGNED_INT, 0);
      return;
    }
    gl.uniform2f(at.size, ...size);
    gl.uniform1f(at.wide, 1.2 * item.width * ratio);
    bind("corner", this.corner, 2, 0, 0, 0);
    bind("from", item.buffer, 3, 24, 0, 1);
    bind("to", item.buffer, 3, 24, 12, 1);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, item.count / 6);
    for (const name of ["from", "to"]) gl.vertexAttribDivisor(gl.getAttribLocation(made, name), 0);
  }

  // Names beside what they name, where none covers another and none is cut.
  label(poses, ratio, dark, names) {
    const { pen, data } = this, points = this.points[data.labelShape], placed = [];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.canvas.clientWidth, this.canvas.clientHeight);
    if (!names) return;
    pen.font = "13px system-ui, sans-serif";
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    data.labels.forEach(({ text, body }, k) => {
      const [x, y, , w] = this.seen(place(poses[body] ?? IDENTITY, points.subarray(3 * k, 3 * k + 3)));
      if (!(w > 0)) return;
      const wide = pen.measureText(text).width, tall = 16;
      let best = null;
      for (const away of [16, 28, 42]) {
        for (let j = 0; j < 8; j += 1) {
          const angle = -Math.PI / 4 + (j * Math.PI) / 4, side = Math.cos(angle);
          const left = Math.min(Math.max(x + away * side - (side < -0.1 ? wide : side < 0.1 ? wide / 2 : 0), 2), this.canvas.clientWidth - wide - 2);
          const top = Math.min(Math.max(y + away * Math.sin(angle) - tall / 2, 2), this.canvas.clientHeight - tall - 2);
          const over = placed.reduce((sum, [l, t, r]) => sum + Math.max(0, Math.min(r, left + wide + 4) - Math.max(l, left)) * Math.max(0, tall - Math.abs(t - top)), 0);
          if (!best || over + away < best[0]) best = [over + away, left, top];
        }
      }
      placed.push([best[1], best[2], best[1] + wide + 4]);
      pen.strokeStyle = dark ? "#17191e" : "#ffffff";
      pen.lineWidth = 4;
      pen.strokeText(text, best[1], best[2] + tall / 2);
      pen.fillStyle = dark ? "#e6e6e6" : "#222222";
      pen.fillText(text, best[1], best[2] + tall / 2);
    });
  }
}

// -- the page -------------------------------------------------------------------------------------------------------------

const get = (id) => document.getElementById(id);
function shown(value, digits = 4) {
  if (!Number.isFinite(value)) return "-";
  const plain = Number(value.toPrecision(digits)), size = Math.abs(plain);
  return size === 0 || (size >= 1e-3 && size < 1e5) ? String(plain) : value.toExponential(digits - 1).replace(/\.?0*e\+?/, "e");
}

function element(kind, parent, properties = {}) {
  const made = document.createElement(kind);
  Object.assign(made, properties);
  parent.append(made);
  return made;
}

class Page {
  constructor(data, model) {
    this.data = data;
    this.model = model;
    this.numbers = new Float32Array(bytesOf(data.numbers).buffer);
    this.picture = new Picture(data, this.numbers, get("picture"), get("over"));
    this.frames = [];
    this.cursor = 0;
    this.playing = true;
    this.names = data.labels.length > 0;
    this.dark = window.matchMedia("(prefers-color-scheme: dark)").matches;
    this.count = 0;
    if (!this.picture.gl) {
      this.say("This page needs WebGL 2, which this browser does not offer here. Switch on hardware acceleration, open the page in another browser, or write the animation as .gif.");
      return;
    }
    this.columns = model ? [...data.model.x, ...data.model.y, "kinetic energy", "potential energy", "energy", "loop residual"] : data.curves.map((one) => one.name);
    this.fill();
    this.listen();
    if (model) {
      this.start = Float64Array.from(data.model.x0);
      this.recorded(data.motion);
      if (!this.frames.length) this.restart();
      else this.replayed = true;
    } else this.frames = data.motion.t.map((t, k) => ({ t, clock: data.motion.clock[k], row: [] }));
    this.last = null;
    requestAnimationFrame((stamp) => this.step(stamp));
  }

  say(text) {
    get("message").textContent = text;
    get("message").hidden = !text;
  }

  // -- states over time --

  recorded(motion) {
    if (!motion) return;
    const { model } = this, n = model.n;
    motion.t.forEach((t, k) => {
      const x = new Float64Array(this.numbers.subarray(motion.states + k * n, motion.states + (k + 1) * n));
      this.keep(t, model.call("project", t, x) ?? x);
    });
  }

  keep(t, x) {
    const { model } = this, energy = model.call("energy", t, x) ?? [NaN, NaN];
    const row = [...x, ...(model.call("outputs", t, x) ?? []), energy[0], energy[1], energy[0] + energy[1], model.residual(t, x)];
    this.frames.push({ t, clock: t, x, row });
    if (this.frames.length > 20000) this.frames.splice(0, 5000);
  }

  // Begin anew from a start.
  restart(x = this.start, words = "") {
    const { model } = this, open = model.residual(0, x);
    this.start = x;
    this.replayed = false;
    this.frames = [];
    this.cursor = 0;
    this.event = "";
    this.say(words || open <= 1e-6 ? words : `the loops are open at the start, by ${shown(open)}`);
    model.begin(0, x);
    this.keep(0, x);
  }

  // What is shown from here on begins at the state shown.
  goOn() {
    const at = this.frames[this.cursor];
    this.frames.length = this.cursor + 1;
    this.replayed = false;
    this.model.begin(at.t, at.x);
  }

  step(stamp) {
    requestAnimationFrame((next) => this.step(next));
    const passed = this.last === null ? 0 : Math.min(0.1, (stamp - this.last) / 1000) * get("speed").value;
    this.last = stamp;
    try {
      if (this.playing && passed > 0) this.proceed(passed);
      this.show();
    } catch (error) {
      this.play(false);
      this.say(`the run stops here: ${error.message}; reset begins anew`);
    }
    this.count += 1;
  }

  proceed(passed) {
    const { frames, model } = this, now = this.clock ?? frames[this.cursor].clock, next = now + passed;
    this.clock = next;
    if (this.cursor + 1 < frames.length) {
      while (this.cursor + 1 < frames.length && frames[this.cursor + 1].clock <= next) this.cursor += 1;
      return;
    }
    if (!model || this.replayed) { // a film begins again
      this.cursor = 0;
      this.clock = frames[0].clock;
      return;
    }
    const { end } = model.info, stops = now < end && next >= end; // the declared run; play goes on
    const span = stops ? end - now : passed;
    const begun = performance.now(), count = Math.ceil(passed * 60 / get("speed").value);
    for (let k = 1; k <= count; k += 1) { // no coarser than the eye sees, however slowly pages are drawn
      const wanted = stops && k === count ? end : now + (span * k) / count, reached = model.advance(wanted, 14), t = reached ? wanted : model.f.web_time();
      if (model.ended && t <= this.frames.at(-1).t) {
        this.play(false);
        this.say(model.ended);
        break;
      }
      this.keep(t, model.state(t));
      this.cursor = this.frames.length - 1;
      this.clock = t;
      this.slow = !reached || performance.now() - begun > 60;
      if (this.slow) break;
    }
    if (this.clock === end) this.play(false);
    for (const [name, time] of model.happened.splice(0)) this.event = `${name} at ${shown(time)} s`;
  }

  play(on) {
    this.playing = on;
    this.clock = undefined;
    get("play").textContent = on ? "\u275a\u275a" : "\u25b6";
  }

  move(by) {
    this.play(false);
    if (this.model && !this.replayed && this.cursor + by >= this.frames.length) {
      this.proceed(get("speed").value / 60);
      this.clock = undefined;
    } else this.cursor = Math.min(this.frames.length - 1, Math.max(0, this.cursor + by));
  }

  poses(k = this.cursor) {
    const frame = this.frames[k], { model, data } = this, found = [];
    if (model) {
      const all = model.call("poses", frame.t, frame.x);
      if (!all) return this.picture.poses;
      data.bodies.forEach((_, body) => found.push(all.subarray(16 * body, 16 * body + 16)));
    } else {
      const at = data.motion.poses + 12 * data.bodies.length * k;
      data.bodies.forEach((_, body) => found.push([...this.numbers.subarray(at + 12 * body, at + 12 * body + 12), 0, 0, 0, 1]));
    }
    found[-1] = IDENTITY;
    return found;
  }

  show() {
    const frame = this.frames[this.cursor], poses = this.poses(), trace = get("trace").value;
    if (trace) this.follow(trace);
    else this.picture.trace.points = [];
    this.picture.draw(poses, this.cursor, this.dark, this.names);
    if (this.changed) this.fit(false);
    const time = get("time");
    time.max = this.frames.length - 1;
    time.value = this.cursor;
    const words = this.model ? `t = ${frame.t.toFixed(2)} s` : this.data.motion.words[this.cursor];
    const pace = this.model && this.playing && this.slow ? "  slower than real time" : "";
    get("words").textContent = words + pace + (this.event ? `  ${this.event}` : "");
    if (this.count % 3 === 0 || !this.playing) this.plot();
    if (this.model && this.count % 6 === 0) this.measure(frame);
  }

  // The view on the run so far, or on all of a film; after a change, wider where the mechanism leaves the view.
  fit(anew) {
    const { picture, data, model, frames } = this, every = anew ? Math.ceil(frames.length / 40) : Infinity;
    const several = model ? frames.map((_, k) => k).filter((k) => k % every === 0 || k === this.cursor).map((k) => this.poses(k)) : [];
    const { low, high } = model ? picture.extent(several) : data, old = anew ? { low, high } : picture;
    this.changed = false;
    const margin = 0.1 * Math.max(...old.high.map((x, k) => x - old.low[k]));
    if (!(low[0] <= high[0]) || (!anew && low.every((x, k) => x >= old.low[k] - margin && high[k] <= old.high[k] + margin))) return;
    picture.low = low.map((x, k) => Math.min(x, old.low[k]));
    picture.high = high.map((x, k) => Math.max(x, old.high[k]));
    picture.fit();
  }

  // The way of a marker, through all frames since it was last drawn.
  follow(name) {
    const [, body, shape] = this.data.markers.find((one) => one[0] === name), { trace, points } = this.picture;
    if (this.traced !== name || this.cursor < this.tracedAt) {
      trace.points = [];
      this.tracedAt = this.cursor - 1;
    }
    this.traced = name;
    while (this.tracedAt < this.cursor) trace.points.push(...place(this.poses(this.tracedAt += 1)[body], points[shape]));
    if (trace.points.length > 9000) trace.points.splice(0, 3000);
  }

  measure(frame) {
    for (const [k, field] of Object.entries(this.fields)) {
      if (![field.box, field.slide].includes(document.activeElement)) this.put(field, frame.x[k]);
    }
    if (this.model.info.rows) get("residual").textContent = `loop residual ${this.model.residual(frame.t, frame.x).toExponential(1)}`;
  }

  // -- plots --

  plot() {
    for (const k of [1, 2]) {
      const canvas = get(`plot${k}`), choice = get(`choice${k}`).value, pen = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
      if (!canvas.clientWidth || canvas.clientWidth < 10) continue;
      const wide = canvas.clientWidth, tall = canvas.clientHeight;
      canvas.width = wide * ratio;
      canvas.height = tall * ratio;
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      const lines = choice === "energies" ? ["kinetic energy", "potential energy", "energy"] : [choice];
      const rows = lines.map((name) => this.series(name));
      const over = rows[0][0], first = Math.max(0, this.model && !this.replayed ? this.cursor - 1200 : 0);
      const last = this.model && !this.replayed ? this.cursor : over.length - 1, values = rows.flatMap(([, v]) => v.slice(first, last + 1)).filter(Number.isFinite);
      if (!values.length) continue;
      let low = Math.min(...values), high = Math.max(...values);
      if (high - low < 1e-6 * Math.max(1e-3, Math.abs(high))) { low -= 0.5 * (Math.abs(low) || 1); high += 0.5 * (Math.abs(high) || 1); }
      const ink = this.dark ? "#e6e6e6" : "#222222", span = over[last] - over[first] || 1;
      const X = (t) => 52 + ((wide - 60) * (t - over[first])) / span, Y = (v) => tall - 18 - ((tall - 26) * (v - low)) / (high - low);
      pen.font = "11px system-ui, sans-serif";
      pen.fillStyle = ink;
      pen.textAlign = "right";
      for (const v of [low, high]) pen.fillText(shown(v, 3), 48, Math.min(tall - 16, Math.max(10, Y(v) + 3)));
      pen.fillText(`${shown(over[last], 3)}`, wide - 6, tall - 4);
      pen.textAlign = "left";
      pen.fillText(shown(over[first], 3), 52, tall - 4);
      rows.forEach(([times, column], j) => {
        pen.strokeStyle = ["#0072B2", "#D55E00", "#009E73"][j];
        pen.lineWidth = 1.6;
        pen.beginPath();
        for (let i = first; i <= last; i += 1) pen.lineTo(X(times[i]), Y(column[i]));
        pen.stroke();
        if (lines.length > 1) { pen.fillStyle = pen.strokeStyle; pen.fillText(["T", "V", "T + V"][j], 120 + 34 * j, tall - 4); }
      });
      const here = this.model ? this.frames[this.cursor].t : this.data.motion.over[this.cursor];
      pen.strokeStyle = ink;
      pen.lineWidth = 1;
      pen.strokeRect(X(here), 4, 0.01, tall - 20);
    }
  }

  series(name) {
    const k = this.columns.indexOf(name);
    if (!this.model) return [this.data.curves[k].over, this.data.curves[k].values];
    return [this.frames.map((frame) => frame.t), this.frames.map((frame) => frame.row[k])];
  }

  // -- controls --

  fill() {
    const { data, model } = this;
    const option = (list, value, text = value) => element("option", list, { value, textContent: text });
    for (const [name] of data.markers) option(get("trace"), name);
    get("trace").parentElement.hidden = !data.markers.length || !model;
    const energies = model && "energy" in model.kernels ? ["energies"] : [], columns = this.columns;
    const units = { energies: "J", "kinetic energy": "J", "potential energy": "J", energy: "J", ...data.units }, label = (name) => (units[name] ? `${name} (${units[name]})` : name);
    for (const k of [1, 2]) for (const name of [...energies, ...columns]) option(get(`choice${k}`), name, label(name));
    if (columns.length) get("choice1").value = columns[0];
    if (columns.length > 1) get("choice2").value = energies[0] ?? columns[1];
    get("plots").hidden = !columns.length;
    for (const factor of [0.1, 0.25, 0.5, 1, 2, 4]) option(get("speed"), factor, `\u00d7${shown(factor * (model ? 1 : data.motion.pace), 2)}`);
    get("speed").value = 1;
    get("named").hidden = !data.labels.length;
    if (!model) return;
    this.fields = {};
    const { info } = model;
    const starts = info.independentQ.map((k) => [k, info.x[k], ...info.ranges[info.x[k]]]);
    for (const [k, name, low, high] of starts) this.fields[k] = this.field("starts", label(name), info.x0[k], low, high, (value) => this.setStart(k, value));
    for (const j of info.independent) {
      const k = info.q.length + j, speed = Math.max(10, 2 * Math.abs(info.x0[k]));
      this.fields[k] = this.field("starts", label(info.x[k]), info.x0[k], -speed, speed, (value) => this.setStart(k, value));
    }
    this.settings = info.p.map((name, k) => this.field("parameters", label(name), info.pValues[k], ...info.ranges[name], (value) => this.setParameter(k, value), info.docs[name]));
    this.forces = info.u.map((name, k) => this.field("inputs", label(name), model.inputs[k], ...info.ranges[name], (value) => this.setInput(k, value), info.docs[name]));
    for (const id of ["parameters", "inputs", "starts"]) get(id).parentElement.hidden = !get(id).children.length;
    info.branches.forEach((_, k) => option(get("branch"), k, `assembly ${k + 1}`));
    get("branch").parentElement.hidden = info.branches.length < 2;
    get("copying").hidden = get("reset").hidden = false;
  }

  // A slider and a box for one value.
  field(home, text, value, low, high, set, about = "") {
    const row = element("label", get(home), { className: "field", title: about });
    element("span", row, { textContent: text });
    const slide = element("input", row, { type: "range", min: low, max: high, step: (high - low) / 500 || 1, value: 0 });
    const box = element("input", row, { inputMode: "text", ariaLabel: text }), made = { slide, box };
    this.put(made, value);
    slide.oninput = () => { this.put(made, Number(slide.value)); set(Number(slide.value)); };
    box.onchange = () => {
      const typed = box.value.trim(), entered = typed ? Number(typed) : NaN, words = home === "inputs" && typed && Number.isNaN(entered);
      if (!words && !Number.isFinite(entered)) { this.settle(); this.say(`${text} must be a finite number, not ${typed || "nothing"}`); return; }
      if (!words) slide.value = entered;
      set(words ? typed : entered);
    };
    return made;
  }

  put({ slide, box }, value) {
    box.value = typeof value === "number" ? shown(value, 6) : value;
    if (typeof value === "number") slide.value = value;
  }

  // Another parameter: the state shown and the start go along; where loops cannot close, both stay.
  setParameter(k, value) {
    const { model } = this, { info, p: before } = model, low = info.bounds[info.p[k]], now = this.frames[this.cursor];
    if (low && !(value >= low[0] && value <= low[1])) {
      this.settle();
      this.say(`${info.p[k]} must be from ${shown(low[0])} to ${shown(low[1])}`);
      return;
    }
    const [x, p, reached] = model.reach(now.t, now.x, before.map((old, i) => (i === k ? value : old)), []);
    model.setParameters(before);
    const [first, , whole] = model.reach(0, this.start, p, []);
    model.setParameters(p);
    this.start = whole ? first : model.close(0, x, info.independent) ?? x;
    this.settle();
    this.replace(now.t, x);
    this.say(!reached ? `the loops do not close with ${info.p[k]} = ${shown(value)}; the mechanism is shown with ${shown(p[k])}`
      : whole ? "" : `the loops do not close at the start with ${info.p[k]} = ${shown(value)}; what is shown is the start from now on`);
  }

  // The parameters that the model has, into the picture and the boxes.
  settle() {
    const { p, info } = this.model;
    this.picture.change(Object.fromEntries(info.p.map((name, k) => [name, p[k]])));
    this.changed = true;
    this.settings.forEach((field, k) => this.put(field, p[k]));
  }

  // Parameters, inputs and start as the model declares them.
  declare() {
    const { model } = this, { info } = model;
    model.setParameters(info.pValues);
    this.forces.forEach((_, k) => this.setInput(k, DECLARED));
    this.settle();
    this.restart(Float64Array.from(info.x0));
  }

  replace(t, x) {
    this.frames.length = this.cursor;
    this.keep(t, x);
    this.goOn();
  }

  // A coordinate or velocity to begin with.
  setStart(k, value) {
    const { model } = this, [x, , reached] = model.reach(0, this.frames[this.cursor].x, model.p, [[k, value]]);
    this.play(false);
    this.restart(x, reached ? "" : `the loops do not close there; the picture shows ${model.info.x[k]} = ${shown(x[k])}`);
  }

  setInput(k, value) {
    const { model } = this;
    try {
      model.setInput(k, value);
      this.put(this.forces[k], model.inputs[k]);
      this.say("");
    } catch (error) {
      this.say(error.message);
      return;
    }
    this.goOn();
  }

  setBranch(k) {
    const { model } = this, x = Float64Array.from(model.info.x0), p = model.p;
    x.set(model.info.branches[k]);
    model.setParameters(model.info.pValues);
    const [closed, , reached] = model.reach(0, model.close(0, x, model.info.independent) ?? x, p, []);
    this.settle();
    this.restart(closed, reached ? "" : "these loops do not close with the parameters set; the boxes show those that they close with");
  }

  reset() {
    if (this.model) this.restart();
    else this.cursor = 0;
    this.clock = undefined;
  }

  copy(kind) {
    const { model, start } = this, { info } = model, number = (x) => String(Number(x.toPrecision(15)));
    const initial = [...info.independentQ, ...info.independent.map((j) => info.q.length + j)].map((k) => [info.x[k], number(start[k])]);
    const parameters = info.p.map((name, k) => [name, number(model.p[k])]);
    const inputs = info.u.map((name, k) => [name, model.inputs[k]]).filter(([, value]) => value !== DECLARED)
      .map(([name, value]) => [name, typeof value === "number" ? number(value) : JSON.stringify(value)]);
    const set = (pairs) => pairs.map(([name, value]) => `${JSON.stringify(name)}: ${value}`).join(", ");
    const text = kind === "python"
      ? `run = mod.simulate(${number(info.end)}, initial={${set(initial)}},\n    parameters={${set(parameters)}}, inputs={${set(inputs)}})`
      : `parameters: {${parameters.map(([name, value]) => `${name}: ${value}`).join(", ")}}\ninitial: {${initial.map(([name, value]) => `${name}: ${value}`).join(", ")}}`;
    const box = get("copied");
    box.value = text;
    box.hidden = false;
    box.select();
    if (navigator.clipboard) navigator.clipboard.writeText(text).catch(() => {});
  }

  listen() {
    const canvas = get("over"), fingers = new Map(), fit = () => this.fit(true);
    get("picture").addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.say("the browser took the picture's memory; it is drawn again when the browser allows, else reload the page"); });
    get("picture").addEventListener("webglcontextrestored", () => {
      this.picture = new Picture(this.data, this.numbers, get("picture"), canvas);
      this.traced = "";
      if (this.model) this.settle();
      this.say("");
    });
    get("declared").onclick = () => this.declare();
    get("play").onclick = () => this.play(!this.playing);
    get("back").onclick = () => this.move(-1);
    get("forth").onclick = () => this.move(1);
    get("reset").onclick = () => this.reset();
    get("time").oninput = () => { this.play(false); this.cursor = Number(get("time").value); };
    get("theme").onclick = () => { this.dark = !this.dark; document.documentElement.dataset.theme = this.dark ? "dark" : "light"; };
    get("named").onclick = () => { this.names = !this.names; };
    get("branch").onchange = () => this.setBranch(Number(get("branch").value));
    get("python").onclick = () => this.copy("python");
    get("yaml").onclick = () => this.copy("yaml");
    document.documentElement.dataset.theme = this.dark ? "dark" : "light";
    const at = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, at(event));
      this.grip = this.model && fingers.size === 1 && !event.shiftKey ? this.picture.pick(...at(event)) : null;
      if (this.grip) this.play(false);
    };
    canvas.onpointermove = (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = at(event), by = [now[0] - before[0], now[1] - before[1]];
      if (fingers.size === 2) {
        const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place_]) => place_);
        this.picture.zoom *= Math.hypot(now[0] - other[0], now[1] - other[1]) / (Math.hypot(before[0] - other[0], before[1] - other[1]) || 1);
      } else if (this.grip) this.drag(now);
      else if (this.data.view || event.shiftKey) this.pan(by);
      else this.orbit(by);
      fingers.set(event.pointerId, now);
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => { fingers.delete(event.pointerId); this.grip = null; };
    canvas.onwheel = (event) => { event.preventDefault(); this.picture.zoom = Math.min(50, Math.max(0.1, this.picture.zoom * Math.exp(-event.deltaY / 500))); };
    canvas.ondblclick = fit;
    document.onkeydown = (event) => {
      const { tagName, type } = event.target, own = { BUTTON: [" "], SUMMARY: [" "], range: ["ArrowLeft", "ArrowRight"] }[type === "range" ? type : tagName];
      if (event.ctrlKey || event.metaKey || event.altKey || own?.includes(event.key)) return;
      if (!own && ["INPUT", "SELECT", "TEXTAREA"].includes(tagName)) return;
      const speeds = get("speed"), faster = (by) => { speeds.selectedIndex = Math.min(5, Math.max(0, speeds.selectedIndex + by)); };
      const keys = { " ": () => this.play(!this.playing), ArrowLeft: () => this.move(-1), ArrowRight: () => this.move(1), r: () => this.reset(), 0: fit, "+": () => faster(1), "-": () => faster(-1), n: () => { this.names = !this.names; } };
      if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
    };
  }

  pan(by) {
    const { picture } = this, size = (2 * picture.half) / (picture.canvas.clientHeight || 1), { right, up } = picture.axes;
    picture.target = plus(plus(picture.target, right, -by[0] * size), up, by[1] * size);
  }

  orbit(by) {
    const { picture } = this, { up } = this.data, c = Math.cos(-by[0] / 150), s = Math.sin(-by[0] / 150);
    const about = (v) => plus(plus(scaled(v, c), cross(up, v), s), up, dot(up, v) * (1 - c));
    let toward = about(picture.toward);
    const lifted = unit(plus(toward, unit(cross(toward, cross(up, toward))), by[1] / 150));
    if (Math.abs(dot(lifted, up)) < 0.99) toward = lifted;
    picture.toward = toward;
  }

  drag([x, y]) {
    const { picture, model, grip } = this, frame = this.frames[this.cursor], { right, up } = picture.axes;
    const here = place(picture.poses[grip.body], grip.local), seen = picture.seen(here);
    const size = ((2 * picture.half) / picture.canvas.clientHeight) * (this.data.view ? 1 : seen[3]);
    const target = plus(plus(here, right, (x - seen[0]) * size), up, (seen[1] - y) * size);
    const axes = [...right, ...up], reach = Math.max(...picture.high.map((h, k) => h - picture.low[k]));
    const moved = model.pull(0, frame.x, grip.body, grip.local, axes, [dot(right, target), dot(up, target)], reach);
    if (!moved || moved.some(Number.isNaN)) { this.say("the loops do not close there"); return; }
    this.restart(moved);
  }
}

if (typeof document === "undefined") globalThis.Model = Model;
else {
  const data = JSON.parse(get("data").textContent);
  const open = data.wasm ? Model.open(data.model, data.wasm) : Promise.resolve(null);
  open.then((model) => { window.page = new Page(data, model); }, (error) => { get("message").textContent = String(error); get("message").hidden = false; });
}
