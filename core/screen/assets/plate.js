// The plate in 3D: its mesh with the colours of its map. Drag or arrow keys turn it, wheel or + and - bring it nearer.

const canvas = document.getElementById('plate');
const gl = canvas.getContext('webgl2', { antialias: true });

const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in vec2 at; uniform mat4 camera; out vec2 uv; out vec3 up;
void main() { uv = at; up = normal; gl_Position = camera * vec4(place, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float; in vec2 uv; in vec3 up; uniform sampler2D map; out vec4 colour;
void main() { float light = 0.72 + 0.28 * abs(dot(normalize(up), normalize(vec3(0.3, -0.4, 0.86)))); colour = vec4(texture(map, uv).rgb * light, 1.0); }`;

const view = { height: 5, azimuth: -0.6, elevation: 0.6, distance: 1.5 };
const FROM = { scanner: [-0.6, 0.6], press: [0, 0.25], above: [0, Math.PI / 2] };
let mesh = null;

const minus = (a, b) => a.map((x, k) => x - b[k]);
const dot = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => a.map(x => x / Math.hypot(...a));

// Positions in the frame of the plate: along u, along v, and height above the plane of its corners; the longer side has length 1.
function flattened(buffer) {
  const side = new DataView(buffer).getUint32(0, true);
  const raw = new Float32Array(buffer.slice(4));
  const node = k => [raw[4 * k], raw[4 * k + 1], raw[4 * k + 2]];
  const corner = [0, side - 1, side * side - 1, side * (side - 1)].map(node);
  const along = unit(minus(corner[1], corner[0]));
  const normal = unit(cross(along, minus(corner[3], corner[0])));
  const across = cross(normal, along);
  const middle = corner[0].map((_, k) => corner.reduce((sum, c) => sum + c[k], 0) / 4);
  const scale = 1 / Math.max(Math.hypot(...minus(corner[1], corner[0])), Math.hypot(...minus(corner[3], corner[0])));
  // The scanner is at the origin, above the plate.
  const up = dot(normal, middle) > 0 ? -1 : 1;
  const places = [];
  for (let k = 0; k < side * side; k++) {
    const from = minus(node(k), middle);
    places.push([dot(from, along) * scale, dot(from, across) * scale, up * dot(from, normal) * scale]);
  }
  return { side, places, seen: places.map((_, k) => raw[4 * k + 3] > 0) };
}

// Vertices with the height of the view: place, normal, place on the map.
function vertices({ side, places }) {
  const at = (i, k) => {
    const [x, y, z] = places[k * side + i];
    return [x, y, z * view.height];
  };
  const clamp = i => Math.min(Math.max(i, 0), side - 1);
  const data = [];
  for (let k = 0; k < side; k++) {
    for (let i = 0; i < side; i++) {
      const u = minus(at(clamp(i + 1), k), at(clamp(i - 1), k));
      const v = minus(at(i, clamp(k + 1)), at(i, clamp(k - 1)));
      data.push(...at(i, k), ...unit(cross(u, v)), i / (side - 1), k / (side - 1));
    }
  }
  return new Float32Array(data);
}

function triangles({ side, seen }) {
  const index = [];
  for (let k = 0; k + 1 < side; k++) {
    for (let i = 0; i + 1 < side; i++) {
      const [a, b, c, d] = [k * side + i, k * side + i + 1, (k + 1) * side + i, (k + 1) * side + i + 1];
      if ([a, b, c, d].every(n => seen[n])) index.push(a, b, c, b, d, c);
    }
  }
  return new Uint32Array(index);
}

// Perspective camera that looks at the middle of the plate; columns.
function camera() {
  const [sa, ca, se, ce] = [Math.sin(view.azimuth), Math.cos(view.azimuth), Math.sin(view.elevation), Math.cos(view.elevation)];
  const eye = [sa * ce * view.distance, -ca * ce * view.distance, se * view.distance];
  const back = unit(eye);
  const right = [ca, sa, 0];
  const up = cross(back, right);
  const [f, near, far, aspect] = [1.8, 0.1, 20, canvas.width / canvas.height];
  const project = (far + near) / (near - far);
  const column = (x, y, z, w) => [(f / aspect) * x, f * y, project * z + (w * 2 * far * near) / (near - far), -z];
  const turned = k => [right[k], up[k], back[k]];
  const place = [-dot(right, eye), -dot(up, eye), -dot(back, eye)];
  return new Float32Array([...[0, 1, 2].flatMap(k => column(...turned(k), 0)), ...column(...place, 1)]);
}

function program() {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  return made;
}

function upload() {
  gl.bufferData(gl.ARRAY_BUFFER, vertices(mesh), gl.STATIC_DRAW);
}

function draw() {
  if (!mesh) return;
  const ratio = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio];
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(0.81, 0.82, 0.83, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.uniformMatrix4fv(mesh.camera, false, camera());
  gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
}

function start(buffer, image) {
  mesh = flattened(buffer);
  const made = program();
  gl.useProgram(made);
  gl.enable(gl.DEPTH_TEST);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  upload();
  [['place', 3, 0], ['normal', 3, 12], ['at', 2, 24]].forEach(([name, size, offset]) => {
    const slot = gl.getAttribLocation(made, name);
    if (slot < 0) return;
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, size, gl.FLOAT, false, 32, offset);
  });
  const index = triangles(mesh);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
  mesh.count = index.length;
  mesh.camera = gl.getUniformLocation(made, 'camera');
  gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  draw();
  canvas.dataset.drawn = String(mesh.count / 3);
}

function turn(azimuth, elevation, nearer = 1) {
  view.azimuth += azimuth;
  view.elevation = Math.min(Math.max(view.elevation + elevation, -1.5), Math.PI / 2);
  view.distance = Math.min(Math.max(view.distance * nearer, 0.7), 8);
  draw();
}

const KEYS = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1], '+': [0, 0, 0.9], '-': [0, 0, 1.1] };
canvas.addEventListener('keydown', event => {
  if (!KEYS[event.key]) return;
  event.preventDefault();
  turn(...KEYS[event.key]);
});
canvas.addEventListener('pointermove', event => { if (event.buttons) turn(-event.movementX * 0.006, event.movementY * 0.006); });
canvas.addEventListener('wheel', event => { event.preventDefault(); turn(0, 0, event.deltaY > 0 ? 1.1 : 0.9); }, { passive: false });
addEventListener('resize', draw);
for (const button of document.querySelectorAll('button[data-height]')) {
  button.addEventListener('click', () => {
    view.height = Number(button.dataset.height);
    for (const other of document.querySelectorAll('button[data-height]')) other.setAttribute('aria-pressed', String(other === button));
    document.getElementById('height').textContent = button.textContent;
    if (mesh) upload();
    draw();
  });
}
for (const button of document.querySelectorAll('button[data-from]')) {
  button.addEventListener('click', () => {
    [view.azimuth, view.elevation] = FROM[button.dataset.from];
    draw();
  });
}

function flat() {
  canvas.hidden = true;
  document.getElementById('flat').hidden = false;
}

async function load() {
  if (!gl) return flat();
  const [buffer, image] = await Promise.all([
    fetch(canvas.dataset.mesh).then(answer => answer.ok ? answer.arrayBuffer() : Promise.reject(answer.status)),
    fetch(canvas.dataset.map).then(answer => answer.ok ? answer.blob() : Promise.reject(answer.status)).then(createImageBitmap),
  ]);
  start(buffer, image);
}
load().catch(flat);
