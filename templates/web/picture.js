"use strict";
// The picture of a page: shapes of bodies, what reaches between them, names and arrows, seen by a camera. WebGL 2, because
// planes and solids of a few thousand faces then take a fraction of a frame on a telephone too; three.js alone would be four
// times the rest of a page.

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
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, preserveDrawingBuffer: true });
    Object.assign(this, { data, numbers, canvas, gl, pen: over.getContext("2d"), low: data.low, high: data.high });
    if (!gl) return;
    this.programs = [MESH, LINE].map((texts) => this.program(texts));
    this.corner = this.filled(new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]), gl.ARRAY_BUFFER);
    this.shapes = data.shapes.map(([at, count]) => numbers.slice(at, at + count));
    this.items = data.items.map((item) => ({ ...item, buffer: gl.createBuffer() })).sort((a, b) => a.layer - b.layer);
    for (const item of this.items.filter((one) => one.faces)) {
      item.corners = Uint32Array.from(numbers.subarray(item.faces[0], item.faces[0] + item.faces[1]));
      item.faceBuffer = this.filled(item.corners, gl.ELEMENT_ARRAY_BUFFER);
    }
    const line = (color, width, alpha = 1) => ({ points: [], buffer: gl.createBuffer(), color, width, alpha, body: -1 });
    this.trace = line("#999999", 1.2);
    this.arrows = [{ ...line("#d6006c", 2), front: true }, { ...line("#7b2fbe", 2), front: true }];
    this.floor = { ...line("#888888", 1, 0.35), points: numbers.slice(data.floor[0], data.floor[0] + data.floor[1]) };
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

  filled(values, kind, buffer = this.gl.createBuffer()) {
    this.gl.bindBuffer(kind, buffer);
    this.gl.bufferData(kind, values, this.gl.DYNAMIC_DRAW);
    return buffer;
  }

  // Shapes at values of parameters: each moves along with those that it depends on.
  change(values) {
    const { data, numbers, shapes } = this;
    this.points = [...shapes];
    for (const { name, at, low, high, moved } of data.morphs) {
      const value = values[name] ?? at, below = value < at, end = below ? low : high;
      if (value === at || end === at) continue;
      for (const [shape, ...places] of moved) {
        const [first, count] = places[below ? 0 : 1], before = this.points[shape];
        this.points[shape] = before.map((x, k) => (k < count ? x + ((value - at) / (end - at)) * numbers[first + k] : x));
      }
    }
    for (const item of this.items) if (!item.follow && !item.frames) this.load(item, this.points[item.shape]);
  }

  // The points of an item into its buffer; of a line, its segments.
  load(item, points) {
    let values = points;
    if (!item.faces) {
      values = [];
      for (let k = 0; k + 5 < points.length; k += 3) {
        const pair = points.slice(k, k + 6);
        if (!pair.some(Number.isNaN)) values.push(...pair);
      }
    }
    item.count = values.length;
    item.drawn = points;
    this.filled(Float32Array.from(values), this.gl.ARRAY_BUFFER, item.buffer);
  }

  // Points in ground axes of what is fixed to no body.
  followed(item, poses) {
    const points = this.points[item.shape], rows = [];
    for (let k = 0; k < points.length; k += 3) rows.push([points[k], points[k + 1], points[k + 2]]);
    const stops = item.stops.map((stop, k) => place(poses[stop.body], rows[k])), rest = rows.slice(stops.length);
    if (item.follow === "Shifted") return rest.flatMap((point) => plus(stops[0], point));
    if (item.follow === "Stretched") {
      const way = plus(stops[1], stops[0], -1), long = Math.hypot(...way), [stop] = item.stops;
      const along = long > 0 ? scaled(way, 1 / long) : turn(poses[stop.body], stop.rotation.map((row) => row[2]));
      const [across, other] = acrossOf(along, item.flat ? this.data.view : null);
      return rest.flatMap(([s, x, y]) => plus(plus(plus(stops[0], way, s), across, x), other, y));
    }
    return stops.flatMap((stop, k) => {
      const { radius, body } = item.stops[k], bends = k > 0 && k + 1 < stops.length && radius;
      return bends ? wound(poses[body], item.stops[k], stop, stops[k - 1], stops[k + 1]).flat() : stop;
    });
  }

  // Arrows for vectors at places: straight ones of forces, arcs of moments, each as long as it is of the largest so far.
  point(list, values, most) {
    const { view } = this.data, size = Math.hypot(...this.high.map((x, k) => x - this.low[k]));
    for (const item of this.arrows) item.points = [];
    list.forEach(([, reaction, turns], k) => {
      const at = [...values.slice(6 * k, 6 * k + 3)], way = [...values.slice(6 * k + 3, 6 * k + 6)], much = Math.hypot(...way);
      most[+turns] = Math.max(most[+turns], much || 0);
      if (!(much > 1e-3 * most[+turns])) return;
      let ahead = scaled(way, 1 / much), [side, other] = acrossOf(ahead, view), points = [at, plus(at, way, (0.2 * size) / most[0])];
      if (turns) {
        const angle = (4.5 * much) / most[1], on = (a) => plus(scaled(side, Math.cos(a)), other, Math.sin(a));
        points = Array.from({ length: 25 }, (_, j) => plus(at, on((angle * j) / 24), 0.05 * size));
        [side, ahead] = [on(angle), cross(ahead, on(angle))];
      }
      const tip = points.at(-1), back = plus(tip, ahead, -0.02 * size), gap = [NaN, NaN, NaN];
      this.arrows[+reaction].points.push(...points, plus(back, side, 0.01 * size), tip, plus(back, side, -0.01 * size), gap);
    });
    for (const item of this.arrows) item.points = item.points.flat();
  }

  // -- camera --

  // The box that the items fill at several poses, with an edge, in axes of the view.
  extent(several) {
    const { view } = this.data, low = [Infinity, Infinity, Infinity], high = low.map((x) => -x);
    for (const { drawn = [], body, follow, frames } of this.items) {
      for (const poses of follow || frames || body < 0 ? [[]] : several) {
        for (let k = 0; k + 2 < drawn.length; k += 3) {
          const at = place(poses[body] ?? IDENTITY, drawn.slice(k, k + 3)), seen = view ? view.map((axis) => dot(axis, at)) : at;
          seen.forEach((x, i) => { if (x < low[i]) low[i] = x; if (x > high[i]) high[i] = x; });
        }
      }
    }
    const edge = 0.07 * Math.max(...high.map((x, i) => x - low[i]));
    return { low: low.map((x) => x - edge), high: high.map((x) => x + edge) };
  }

  fit() {
    const { view, up } = this.data, middle = this.low.map((x, k) => 0.5 * (x + this.high[k]));
    const depth = unit(cross(Math.abs(up[0]) > 0.5 ? [0, 1, 0] : [1, 0, 0], up));
    this.zoom = 1;
    this.target = view ? [0, 1, 2].map((k) => dot(middle, view.map((axis) => axis[k]))) : middle;
    this.toward = view ? view[2] : unit(plus(plus(scaled(depth, 0.75), cross(up, depth), 0.45), up, 0.4));
    this.up = view ? view[1] : up;
  }

  look() {
    const { canvas, toward, target, data } = this, wide = canvas.clientWidth || 1, tall = canvas.clientHeight || 1;
    const size = this.high.map((x, k) => x - this.low[k]), span = Math.hypot(...size), right = unit(cross(this.up, toward));
    const half = data.view ? 0.53 * Math.max(size[1], (size[0] * tall) / wide) : 0.46 * span * Math.max(1, (0.9 * tall) / wide);
    const h = half / this.zoom, near = 3.2 * h, up = cross(toward, right); // h: half of what is seen upwards at the target
    const row = (axis, constant) => [...axis, constant - dot(axis, target)];
    const w = data.view ? [0, 0, 0, 1] : row(scaled(toward, -1 / near), 1);
    let z = row(scaled(toward, -1 / (4 * h + span)), 0);
    if (!data.view) { // depth between 0.02 and far of the eye, as a fraction
      const close = 0.02 * near, end = near + 2 * span, a = (end + close) / (end - close), b = (2 * end * close) / (end - close);
      z = w.map((x, k) => a * x - (k === 3 ? b / near : 0));
    }
    const rows = [row(scaled(right, tall / wide / h), 0), row(scaled(up, 1 / h), 0), z, w];
    Object.assign(this, { half: h, axes: { right, up } });
    this.matrix = Float32Array.from({ length: 16 }, (_, k) => rows[k % 4][k >> 2]);
  }

  // Where a point is seen: dots from the left and from the top, and how far away.
  seen(point) {
    const m = this.matrix, { clientWidth, clientHeight } = this.canvas;
    const at = [0, 1, 2, 3].map((r) => m[r] * point[0] + m[4 + r] * point[1] + m[8 + r] * point[2] + m[12 + r]);
    return [(0.5 + (0.5 * at[0]) / at[3]) * clientWidth, (0.5 - (0.5 * at[1]) / at[3]) * clientHeight, at[2] / at[3], at[3]];
  }

  // The body under a dot, and the point of it that is nearest to the reader.
  pick(x, y) {
    let best = null;
    for (const { corners, body, follow, drawn, layer } of this.items) {
      if (!corners || body < 0 || follow) continue;
      const local = Array.from({ length: drawn.length / 3 }, (_, k) => drawn.subarray(3 * k, 3 * k + 3));
      const seen = local.map((point) => this.seen(place(this.poses[body], point)));
      for (let k = 0; k < corners.length; k += 3) {
        const [a, b, c] = corners.subarray(k, k + 3), [p, q, r] = [seen[a], seen[b], seen[c]];
        const area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        const s = ((x - p[0]) * (r[1] - p[1]) - (y - p[1]) * (r[0] - p[0])) / area;
        const u = ((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])) / area;
        if (!(s >= 0 && u >= 0 && s + u <= 1)) continue;
        const depth = this.data.view ? -layer : p[2] + s * (q[2] - p[2]) + u * (r[2] - p[2]);
        if (best && depth > best.depth) continue;
        const at = [0, 1, 2].map((j) => (1 - s - u) * local[a][j] + s * local[b][j] + u * local[c][j]);
        best = { body, local: at, depth };
      }
    }
    return best;
  }

  // -- drawing --

  colored(color, alpha, dark, paper) {
    let rgb = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16) / 255);
    const grey = Math.max(...rgb) - Math.min(...rgb) < 0.06 && (this.data.view || rgb[0] < 0.6);
    if (dark && grey) rgb = rgb.map((x) => 0.95 - 0.85 * x);
    return this.data.view ? [...rgb.map((x, k) => alpha * x + (1 - alpha) * paper[k]), 1] : [...rgb, alpha];
  }

  draw(poses, frame, dark, names) {
    const { gl, canvas, data, pen, numbers } = this, ratio = window.devicePixelRatio || 1;
    const size = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    for (const one of [canvas, pen.canvas]) if (one.width !== size[0] || one.height !== size[1]) [one.width, one.height] = size;
    this.poses = poses;
    this.look();
    const paper = dark ? [0.09, 0.1, 0.12] : [1, 1, 1];
    gl.viewport(0, 0, ...size);
    gl.clearColor(...paper, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const list = [this.floor, ...this.items, this.trace];
    if (!data.view) list.sort((a, b) => b.alpha - a.alpha);
    for (const item of [...list, ...this.arrows]) {
      const { frames, size: length } = item;
      if (frames) this.load(item, numbers.subarray(frames + frame * length, frames + (frame + 1) * length));
      else if (item.follow) this.load(item, Float32Array.from(this.followed(item, poses)));
      else if (item.points && item.points !== item.drawn) this.load(item, item.points);
      (data.view || item.front ? gl.disable : gl.enable).call(gl, gl.DEPTH_TEST);
      if (item.count) this.drawItem(item, poses, size, ratio, this.colored(item.color, item.alpha, dark, paper));
    }
    this.label(poses, ratio, dark, names);
  }

  drawItem(item, poses, size, ratio, color) {
    const { gl } = this, { made, at } = this.programs[item.faces ? 0 : 1];
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.pose, true, (item.follow || item.frames ? null : poses[item.body]) ?? IDENTITY);
    gl.uniformMatrix4fv(at.camera, false, this.matrix);
    gl.uniform4f(at.color, ...color);
    (color[3] < 1 ? gl.enable : gl.disable).call(gl, gl.BLEND);
    gl.depthMask(color[3] === 1);
    const bind = (name, buffer, count, stride, offset, each) => {
      const there = gl.getAttribLocation(made, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(there);
      gl.vertexAttribPointer(there, count, gl.FLOAT, false, stride, offset);
      gl.vertexAttribDivisor(there, each);
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
    const { pen, data } = this, { clientWidth, clientHeight } = this.canvas, tall = 16, placed = [];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, clientWidth, clientHeight);
    if (!names) return;
    Object.assign(pen, { font: "13px system-ui, sans-serif", textBaseline: "middle", lineJoin: "round", lineWidth: 4 });
    [pen.strokeStyle, pen.fillStyle] = dark ? ["#17191e", "#e6e6e6"] : ["#ffffff", "#222222"];
    data.labels.forEach(({ text, body }, k) => {
      const point = this.points[data.labelShape].subarray(3 * k, 3 * k + 3), wide = pen.measureText(text).width;
      const [x, y, , w] = this.seen(place(poses[body] ?? IDENTITY, point));
      if (!(w > 0)) return;
      const within = (at, most) => Math.min(Math.max(at, 2), most - 2);
      let best = [Infinity];
      for (const away of [16, 28, 42]) {
        for (let angle = -Math.PI / 4; angle < 1.7 * Math.PI; angle += Math.PI / 4) {
          const side = Math.cos(angle), begin = side < -0.1 ? wide : side < 0.1 ? wide / 2 : 0;
          const left = within(x + away * side - begin, clientWidth - wide);
          const top = within(y + away * Math.sin(angle) - tall / 2, clientHeight - tall);
          const over = ([l, t]) => Math.max(0, tall - Math.abs(t - top)); // of heights
          const common = ([l, , r]) => Math.max(0, Math.min(r, left + wide + 4) - Math.max(l, left)); // of widths
          const covered = placed.reduce((sum, box) => sum + common(box) * over(box), 0);
          if (covered + away < best[0]) best = [covered + away, left, top];
        }
      }
      const [, left, top] = best;
      placed.push([left, top, left + wide + 4]);
      pen.strokeText(text, left, top + tall / 2);
      pen.fillText(text, left, top + tall / 2);
    });
  }
}
