"use strict";
/* The 3-D replay: WebGL 1, no library. Poses and meshes come from the page's JSON blocks (see report/replay.py). */
(function () {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const floats = (text) => new Float32Array(bytes(text).buffer);
  const data = (id) => JSON.parse(document.getElementById(id).textContent);
  const VERTEX = `
    attribute vec3 vertex; attribute vec3 normal; attribute vec4 color;
    uniform vec4 turn; uniform vec3 place; uniform vec3 stretch; uniform mat4 view;
    varying vec3 vNormal; varying vec4 vColor; varying vec3 vWorld;
    vec3 rotate(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
    void main() {
      vec3 world = rotate(turn, vertex * stretch) + place;
      vNormal = rotate(turn, normal); vColor = color; vWorld = world;
      gl_Position = view * vec4(world, 1.0);
    }`;
  const FRAGMENT = `
    precision mediump float;
    varying vec3 vNormal; varying vec4 vColor; varying vec3 vWorld; uniform vec3 eye; uniform float plain;
    void main() {
      vec3 n = normalize(vNormal), e = normalize(eye - vWorld);
      if (!gl_FrontFacing) n = -n;
      float key = max(dot(n, normalize(vec3(0.35, -0.55, 0.76))), 0.0);
      float rim = max(dot(n, normalize(vec3(-0.7, 0.5, 0.2))), 0.0);
      float gloss = pow(max(dot(n, normalize(e + normalize(vec3(0.35, -0.55, 0.76)))), 0.0), 40.0);
      vec3 lit = vColor.rgb * (0.46 + 0.5 * key + 0.12 * rim + 0.12 * n.z) + 0.10 * gloss;
      gl_FragColor = vec4(mix(lit, vColor.rgb, plain), 1.0) * vColor.a;
    }`;

  function program(gl) {
    const result = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(result, shader);
    }
    ["vertex", "normal", "color"].forEach((name, i) => gl.bindAttribLocation(result, i, name));
    gl.linkProgram(result);
    if (!gl.getProgramParameter(result, gl.LINK_STATUS)) throw new Error("shader: " + gl.getProgramInfoLog(result));
    return result;
  }

  function buffer(gl, kind, values) {
    const result = gl.createBuffer();
    gl.bindBuffer(kind, result); gl.bufferData(kind, values, gl.STATIC_DRAW);
    return result;
  }

  function mesh(gl, packed) {
    const faces = bytes(packed.faces).buffer;
    const index = packed.wide ? new Uint32Array(faces) : new Uint16Array(faces);
    return {
      vertices: buffer(gl, gl.ARRAY_BUFFER, floats(packed.vertices)),
      normals: buffer(gl, gl.ARRAY_BUFFER, new Int8Array(bytes(packed.normals).buffer)),
      colors: buffer(gl, gl.ARRAY_BUFFER, bytes(packed.colors)),
      faces: buffer(gl, gl.ELEMENT_ARRAY_BUFFER, index),
      count: index.length, type: packed.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT,
    };
  }

  /* A unit arrow along z: shaft to 0.75, head to 1. */
  function arrow(gl, rgb) {
    const profile = [[0, 0], [1, 0], [1, 0.75], [2.2, 0.75], [0, 1]], sides = 16, v = [], n = [], c = [], f = [];
    profile.forEach(([r, z], row) => {
      for (let i = 0; i < sides; i++) {
        const a = 2 * Math.PI * i / sides;
        v.push(r * Math.cos(a), r * Math.sin(a), z); n.push(127 * Math.cos(a), 127 * Math.sin(a), row > 2 ? 40 : 0, );
        c.push(...rgb, 255);
        if (row) { const p = (row - 1) * sides, q = (i + 1) % sides, s = row * sides; f.push(p + i, p + q, s + q, p + i, s + q, s + i); }
      }
    });
    return {
      vertices: buffer(gl, gl.ARRAY_BUFFER, new Float32Array(v)), normals: buffer(gl, gl.ARRAY_BUFFER, new Int8Array(n)),
      colors: buffer(gl, gl.ARRAY_BUFFER, new Uint8Array(c)), faces: buffer(gl, gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(f)),
      count: f.length, type: gl.UNSIGNED_SHORT,
    };
  }

  function path(gl, points, rgb) {
    const count = points.length / 3, colors = new Uint8Array(4 * count), normals = new Int8Array(3 * count);
    for (let i = 0; i < count; i++) { colors.set([...rgb, 255], 4 * i); normals[3 * i + 2] = 127; }
    return { vertices: buffer(gl, gl.ARRAY_BUFFER, points), normals: buffer(gl, gl.ARRAY_BUFFER, normals), colors: buffer(gl, gl.ARRAY_BUFFER, colors), count };
  }

  /* One WebGL context draws for every viewer on the page (browsers allow about sixteen); null where there is none. */
  let shared;
  function studio() {
    if (shared !== undefined) return shared;
    const canvas = document.createElement("canvas"), gl = canvas.getContext("webgl", { antialias: true, alpha: true });
    if (!gl) return (shared = null);
    gl.getExtension("OES_element_index_uint");
    const linked = program(gl), at = {};
    gl.useProgram(linked);
    for (const name of ["turn", "place", "stretch", "view", "eye", "plain"]) at[name] = gl.getUniformLocation(linked, name);
    gl.enable(gl.DEPTH_TEST); gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1, 1);
    return (shared = { canvas, gl, at, scenes: {} });
  }

  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => { const s = Math.hypot(...a) || 1; return a.map((x) => x / s); };

  /* Projection times view, column major; z of base points up. */
  function viewMatrix(eye, target, fov, aspect, near, far) {
    const b = unit(sub(eye, target)), r = unit(cross([0, 0, 1], b)), u = cross(b, r);
    const s = 1 / Math.tan(fov / 2), p = (far + near) / (near - far), q = 2 * far * near / (near - far);
    const rows = [[...r, -dot(r, eye)], [...u, -dot(u, eye)], [...b, -dot(b, eye)]];
    const full = [rows[0].map((x) => x * s / aspect), rows[1].map((x) => x * s),
      [rows[2][0] * p, rows[2][1] * p, rows[2][2] * p, rows[2][3] * p + q], rows[2].map((x) => -x)];
    const result = [];
    for (let column = 0; column < 4; column++) for (let row = 0; row < 4; row++) result.push(full[row][column]);
    return new Float32Array(result);
  }

  class Viewer {
    constructor(root) {
      this.root = root;
      this.find = (name) => root.querySelector("." + name);
      this.canvas = root.querySelector("canvas");
      this.run = data(root.dataset.run);
      for (const key of ["poses", "point", "wanted", "force"]) this.run[key] = floats(this.run[key]);
      this.time = this.run.start;
      this.playing = false;
      this.plots = Array.from((root.closest(".run") || root).querySelectorAll("svg.time"));
      this.look(this.run.close);
      this.controls();
      if (!this.open()) return;
      this.show(this.time);
    }

    open() {
      const place = studio();
      if (!place) {
        this.find("screen").classList.add("missing");
        this.find("readout").textContent = "This browser has no WebGL; the stills and plots show the run.";
        return false;
      }
      const gl = place.gl, key = this.run.scene;
      this.gl = gl; this.at = place.at; this.paper = this.canvas.getContext("2d");
      place.scenes[key] = place.scenes[key] || data(key).bodies.map((body) => ({ whole: mesh(gl, body.mesh), cut: body.cut && mesh(gl, body.cut) }));
      this.bodies = place.scenes[key];
      this.arrow = arrow(gl, [214, 64, 69]);
      this.paths = [path(gl, this.run.wanted, [120, 130, 145]), path(gl, this.run.point, [29, 120, 200])];
      new ResizeObserver(() => this.draw()).observe(this.canvas);
      return true;
    }

    look(camera) { this.camera = { ...camera, target: [...camera.target] }; }

    controls() {
      const slider = this.find("slider");
      slider.max = this.run.frames - 1;
      slider.addEventListener("input", () => { this.pause(); this.show(this.timeOf(Number(slider.value))); });
      this.find("play").addEventListener("click", () => (this.playing ? this.pause() : this.play()));
      for (const name of ["cut", "arrow", "path"]) this.find(name).addEventListener("change", () => this.draw());
      for (const [name, other] of [["near", "far"], ["far", "near"]]) {
        this.find(name).addEventListener("click", () => {
          this.look(name === "near" ? this.run.close : this.run.far);
          this.find(name).setAttribute("aria-pressed", "true"); this.find(other).setAttribute("aria-pressed", "false");
          this.draw();
        });
      }
      this.pointer();
      for (const plot of this.plots) {
        const seek = (event) => {
          const box = plot.getBoundingClientRect(), d = plot.dataset;
          const x = (event.clientX - box.left) / box.width * Number(d.width);
          const share = (x - d.left) / (d.right - d.left);
          if (share >= 0 && share <= 1) { this.pause(); this.show(Number(d.start) + share * (d.stop - d.start)); }
        };
        plot.addEventListener("pointermove", (event) => { if (event.pointerType === "mouse") seek(event); });
        plot.addEventListener("click", seek);
      }
    }

    pointer() {
      const held = new Map();
      let spread = 0;
      this.canvas.addEventListener("pointerdown", (e) => { this.canvas.setPointerCapture(e.pointerId); held.set(e.pointerId, [e.clientX, e.clientY]); spread = 0; });
      const drop = (e) => { held.delete(e.pointerId); spread = 0; };
      this.canvas.addEventListener("pointerup", drop); this.canvas.addEventListener("pointercancel", drop);
      this.canvas.addEventListener("pointermove", (e) => {
        if (!held.has(e.pointerId)) return;
        const [x, y] = held.get(e.pointerId), dx = e.clientX - x, dy = e.clientY - y;
        held.set(e.pointerId, [e.clientX, e.clientY]);
        if (held.size === 2) {
          const [a, b] = [...held.values()], now = Math.hypot(a[0] - b[0], a[1] - b[1]);
          if (spread) this.zoom(spread / now);
          spread = now; this.pan(dx / 2, dy / 2);
        } else if (e.shiftKey || e.buttons === 2 || e.buttons === 4) this.pan(dx, dy);
        else this.orbit(dx, dy);
        this.draw();
      });
      this.canvas.addEventListener("contextmenu", (e) => e.preventDefault());
      this.canvas.addEventListener("wheel", (e) => {
        if (document.activeElement !== this.canvas && !e.ctrlKey) return;
        e.preventDefault(); this.zoom(Math.exp(0.0012 * e.deltaY)); this.draw();
      }, { passive: false });
      this.canvas.addEventListener("keydown", (e) => {
        const turn = { ArrowLeft: [-24, 0], ArrowRight: [24, 0], ArrowUp: [0, -24], ArrowDown: [0, 24] }[e.key];
        if (turn) this.orbit(...turn); else if (e.key === "+") this.zoom(0.85); else if (e.key === "-") this.zoom(1.18);
        else if (e.key === " ") this.find("play").click(); else return;
        e.preventDefault(); this.draw();
      });
    }

    orbit(dx, dy) {
      this.camera.azimuth -= 0.008 * dx;
      this.camera.elevation = Math.min(1.54, Math.max(-1.2, this.camera.elevation + 0.008 * dy));
    }

    zoom(factor) { this.camera.distance = Math.min(20, Math.max(0.02, this.camera.distance * factor)); }

    pan(dx, dy) {
      const back = this.backward(), right = unit(cross([0, 0, 1], back)), up = cross(back, right);
      const scale = 2 * this.camera.distance * Math.tan(this.camera.fov / 2) / (this.canvas.clientHeight || 1);
      for (let i = 0; i < 3; i++) this.camera.target[i] += scale * (-dx * right[i] + dy * up[i]);
    }

    backward() {
      const { azimuth, elevation } = this.camera, c = Math.cos(elevation);
      return [c * Math.cos(azimuth), c * Math.sin(azimuth), Math.sin(elevation)];
    }

    timeOf(frame) { return this.run.start + (this.run.stop - this.run.start) * frame / Math.max(this.run.frames - 1, 1); }

    play() {
      if (this.time >= this.run.stop - 1e-9) this.time = this.run.start;
      this.playing = true; this.find("play").textContent = "Pause";
      let last = null;
      const tick = (now) => {
        if (!this.playing) return;
        const step = last === null ? 0 : (now - last) / 1000 * Number(this.find("speed").value);
        last = now;
        this.show(Math.min(this.time + step, this.run.stop));
        if (this.time >= this.run.stop) this.pause(); else requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }

    pause() { this.playing = false; this.find("play").textContent = "Play"; }

    /* Values between two frames, linearly. */
    sample(values, width, offset = 0, size = width) {
      const { start, stop, frames } = this.run;
      const at = stop > start ? (this.time - start) / (stop - start) * (frames - 1) : 0;
      const low = Math.min(Math.floor(at), frames - 1), high = Math.min(low + 1, frames - 1), share = at - low;
      const result = [];
      for (let i = offset; i < offset + size; i++) result.push(values[low * width + i] * (1 - share) + values[high * width + i] * share);
      return result;
    }

    show(time) {
      this.time = time;
      const force = this.sample(this.run.force, 3), clock = time.toFixed(2) + " s";
      this.find("slider").value = Math.round((time - this.run.start) / Math.max(this.run.stop - this.run.start, 1e-9) * (this.run.frames - 1));
      this.find("slider").setAttribute("aria-valuetext", clock);
      this.find("clock").textContent = clock;
      if (this.gl) this.find("readout").textContent = "contact force " + Math.hypot(...force).toFixed(1) + " N";
      for (const plot of this.plots) {
        const d = plot.dataset, cursor = plot.querySelector(".cursor");
        const share = Math.min(Math.max((time - d.start) / Math.max(d.stop - d.start, 1e-9), 0), 1);
        cursor.setAttribute("transform", "translate(" + (Number(d.left) + share * (d.right - d.left)).toFixed(1) + " 0)");
        cursor.style.visibility = "visible";
      }
      this.draw();
    }

    draw() {
      const gl = this.gl;
      if (!gl) return;
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio)), height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
      for (const canvas of [this.canvas, shared.canvas]) {
        if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      }
      gl.viewport(0, 0, width, height); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const { target, distance, fov } = this.camera, back = this.backward(), eye = target.map((t, i) => t + distance * back[i]);
      gl.uniformMatrix4fv(this.at.view, false, viewMatrix(eye, target, fov, width / height, 0.02 * distance, 20 * distance + 4));
      gl.uniform3fv(this.at.eye, eye); gl.uniform3f(this.at.stretch, 1, 1, 1); gl.uniform1f(this.at.plain, 0);
      const cut = this.find("cut").checked, count = this.bodies.length;
      this.bodies.forEach((body, i) => {
        const pose = this.sample(this.run.poses, 7 * count, 7 * i, 7);
        this.paint(cut && body.cut ? body.cut : body.whole, pose.slice(0, 3), unit(pose.slice(3)));
      });
      if (this.find("path").checked) this.drawPaths();
      if (this.find("arrow").checked) this.drawForce();
      this.paper.clearRect(0, 0, width, height); this.paper.drawImage(shared.canvas, 0, 0);
    }

    paint(item, place, turn, mode) {
      const gl = this.gl;
      gl.uniform3fv(this.at.place, place); gl.uniform4fv(this.at.turn, turn);
      for (const [slot, values, size, kind, scaled] of [[0, item.vertices, 3, gl.FLOAT, false], [1, item.normals, 3, gl.BYTE, true], [2, item.colors, 4, gl.UNSIGNED_BYTE, true]]) {
        gl.bindBuffer(gl.ARRAY_BUFFER, values); gl.enableVertexAttribArray(slot); gl.vertexAttribPointer(slot, size, kind, scaled, 0, 0);
      }
      if (mode === undefined) { gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, item.faces); gl.drawElements(gl.TRIANGLES, item.count, item.type, 0); }
      else gl.drawArrays(mode, 0, item.count);
    }

    drawPaths() {
      this.gl.uniform1f(this.at.plain, 1); this.gl.disable(this.gl.DEPTH_TEST);
      for (const item of this.paths) this.paint(item, [0, 0, 0], [0, 0, 0, 1], this.gl.LINE_STRIP);
      this.gl.uniform1f(this.at.plain, 0); this.gl.enable(this.gl.DEPTH_TEST);
    }

    /* The arrow's length is the force: a quarter of the view for the run's peak. */
    drawForce() {
      const force = this.sample(this.run.force, 3), size = Math.hypot(...force), gl = this.gl;
      if (size < 0.02 * this.run.peak || !this.run.peak) return;
      const z = unit(force), c = z[2], turn = c < -0.9999 ? [1, 0, 0, 0] : unit([-z[1], z[0], 0, 1 + c]);
      const scale = 0.2 * this.camera.distance, thick = 0.006 * this.camera.distance;
      gl.uniform3f(this.at.stretch, thick, thick, Math.max(scale * size / this.run.peak, 3 * thick)); gl.disable(gl.DEPTH_TEST);
      this.paint(this.arrow, this.sample(this.run.point, 3), turn);
      gl.uniform3f(this.at.stretch, 1, 1, 1); gl.enable(gl.DEPTH_TEST);
    }
  }

  const viewers = Array.from(document.querySelectorAll(".viewer"));
  const startNext = () => { if (viewers.length) { new Viewer(viewers.shift()); setTimeout(startNext, 0); } };
  startNext();
})();
