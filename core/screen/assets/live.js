// Keeps a page up to date. Every event carries all cells of the page; nothing is computed here but staleness: a page that has heard
// nothing for 1.5 s of its own clock, or whose press cycle stands still, shows no verdict, place or number.

const meta = document.querySelector('meta[name="platen-live"]');
const data = meta.dataset;
const SILENCE_MS = 1500;
const RETRY_MS = 300;
const CELLS = 'span[id], p[id], img[id], rect[id]';

let stream = null;
let heard = performance.now();
let stale = null;

function put(id, cell) {
  const element = document.getElementById(id);
  if (!element) return;
  if (cell.text !== undefined && element.textContent !== cell.text) {
    element.textContent = cell.text;
    changed(element);
  }
  for (const [name, value] of Object.entries(cell.attributes ?? {})) {
    if (value === null) element.removeAttribute(name);
    else if (element.getAttribute(name) !== value) element.setAttribute(name, value);
  }
}

// Marks what has changed in a table, for a moment.
function changed(element) {
  if (!element.closest('td')) return;
  element.className = 'changed';
  clearTimeout(element.fading);
  element.fading = setTimeout(() => element.removeAttribute('class'), 3000);
}

// Removes everything that was received, and shows the reason.
function silence(reason, words, remedy) {
  if (stale === reason) return;
  stale = reason;
  for (const element of document.querySelectorAll(CELLS)) {
    if (element.tagName === 'IMG') element.removeAttribute('src');
    else if (element.tagName === 'rect') element.setAttribute('width', '0');
    else element.textContent = '';
  }
  put('band', { attributes: { class: 'band lost' } });
  put('alarm', { attributes: { class: 'alarm none' } });
  put('verdict', { text: words });
  put('why', { text: remedy });
}

function state(event) {
  for (const [id, cell] of Object.entries(JSON.parse(event.data))) put(id, cell);
  heard = performance.now();
  stale = null;
}

function beat(event) {
  heard = performance.now();
  const { boot, cycle_age_ms: age } = JSON.parse(event.data);
  if (boot !== data.boot) location.reload();
  else if (age > Number(data.cycleMs)) silence('stuck', data.stuck, data.stuckRemedy);
  else if (stale) open();
}

function close() {
  stream?.close();
  stream = null;
}

// Opens the events anew: the first is the whole state.
function open() {
  close();
  if (document.hidden) return;
  stream = new EventSource(meta.content);
  stream.addEventListener('state', state);
  stream.addEventListener('beat', beat);
  stream.addEventListener('error', () => {
    close();
    setTimeout(() => stream ?? open(), RETRY_MS);
  });
}

let looked = Date.now();

function watch() {
  // Time has passed that the page's own clock has not seen: the computer slept.
  if (Date.now() - looked > SILENCE_MS) shown();
  looked = Date.now();
  if (performance.now() - heard > SILENCE_MS) silence('lost', data.lost, data.lostRemedy);
}

// A hidden page has no connection, and shows nothing when it comes back.
function shown() {
  if (document.hidden) close();
  else {
    silence('lost', data.lost, data.lostRemedy);
    open();
  }
}

document.addEventListener('visibilitychange', shown);
addEventListener('pageshow', event => { if (event.persisted) shown(); });
setInterval(watch, 100);
open();
