// @ts-check
// What does each sign tell? A sign is picked (click, or its number), then a square is marked (click, or arrow keys and
// Enter). The text fields of the form hold the marks; without scripts they are filled in by hand.

import { build } from "../board/drawing.js";
import { cellAt, markBoard } from "../board/grid.js";
import { plane } from "../board/tokens.js";
import { startBar } from "../lib/bar.js";
import { el, find } from "../lib/dom.js";
import { Form } from "../lib/form.js";
import { keyName } from "../lib/keys.js";
import { Marks } from "../lib/marks.js";
import { watchWindow } from "../lib/watch.js";

/** @import { Sign } from "../lib/types.js" */

/** @type {{ events_url: string, page: string, size: number, signs: Sign[] }} */
const data = JSON.parse(find("#page-data").textContent ?? "{}");
const form = new Form();
const numbers = data.signs.map(({ number }) => number).sort((a, b) => a - b);
const marks = new Marks(numbers, data.size);

for (const item of form.items) marks.restore(signOf(item), form.value(item));
marks.picked = marks.next;

const area = find("#mark-board");
const picture = el("div", { class: "board-wrap" });
const board = el("div", {
  class: "mark-area",
  tabindex: "0",
  role: "application",
  "aria-label": "Board: arrow keys move, Enter marks",
  "aria-describedby": "mark-told",
});
const told = el("p", { id: "mark-told", class: "mark-told", role: "status" });
const panel = el("div", { class: "plane-wrap card" });
const keys = numbers.map((number) => {
  const key = el("button", { class: "key", type: "button", "data-sign": String(number) }, String(number));
  key.addEventListener("click", () => pick(number));
  return key;
});
const eraser = el("button", { class: "button button-small", type: "button" }, "Remove mark");

/** @param {HTMLElement} item */
function signOf(item) {
  return Number(item.dataset.key?.replace("sign_", ""));
}

function draw() {
  const { picked } = marks;
  const focused = document.activeElement === board;
  const cursor = picked !== null && focused ? marks.cursor : null;
  picture.replaceChildren(build(markBoard({ size: data.size, marks: marks.all(), picked, cursor })));
  const label = `${numbers.length} signs${picked === null ? "" : `; sign ${picked} is picked`}`;
  panel.replaceChildren(build(plane({ signs: data.signs, said: null, aim: picked, blank: false, pick: true, label })));
  for (const key of keys) {
    const number = Number(key.dataset.sign);
    const marked = marks.cellOf(number) !== null;
    key.classList.toggle("key-on", number === picked);
    key.classList.toggle("is-marked", marked);
    key.setAttribute("aria-pressed", String(number === picked));
    key.setAttribute("aria-label", marked ? `Sign ${number}, marked` : `Sign ${number}`);
  }
  eraser.disabled = picked === null || marks.cellOf(picked) === null;
  const text = tell();
  if (told.textContent !== text) told.textContent = text;
}

function tell() {
  const { picked } = marks;
  if (picked === null) return "Pick a sign: click it, or press its number.";
  const cell = marks.cellOf(picked);
  const place = (/** @type {readonly number[]} */ [row = 0, column = 0]) => `row ${row + 1}, column ${column + 1}`;
  if (document.activeElement === board && (!cell || String(cell) !== String(marks.cursor)))
    return `Sign ${picked}: ${place(marks.cursor)}. Enter marks this square.`;
  return cell
    ? `Sign ${picked} is at ${place(cell)}.`
    : `Sign ${picked}: which square? Click it, or use arrow keys and Enter.`;
}

/** @param {number} number */
function pick(number) {
  if (marks.pick(number)) draw();
}

/** @param {number} stamp of the event */
function mark(stamp) {
  const number = marks.mark();
  if (number !== null) form.answer(`sign_${number}`, marks.value(number), stamp);
  draw();
}

eraser.addEventListener("click", (event) => erase(event.timeStamp));

/** @param {number} stamp */
function erase(stamp) {
  const number = marks.erase();
  if (number !== null) form.answer(`sign_${number}`, "", stamp);
  draw();
}

board.addEventListener("click", (event) => {
  const { left, top, width, height } = picture.getBoundingClientRect();
  marks.cursor = cellAt(data.size, { x: (event.clientX - left) / width, y: (event.clientY - top) / height });
  mark(event.timeStamp);
});

board.addEventListener("keydown", (event) => {
  if (event.key === "Enter" && !event.repeat) mark(event.timeStamp);
  else if (event.key === "Delete" || event.key === "Backspace") erase(event.timeStamp);
  else if (!marks.move(keyName(event))) return;
  event.preventDefault();
  draw();
});

for (const event of ["focus", "blur"]) board.addEventListener(event, draw);

document.addEventListener("keydown", (event) => {
  const number = Number(/^digit-(\d)$/.exec(keyName(event) ?? "")?.[1]);
  if (event.repeat || !numbers.includes(number)) return;
  board.focus();
  pick(number);
});

panel.addEventListener("click", (event) => {
  const sign = /** @type {SVGElement | null} */ (/** @type {Element} */ (event.target).closest("[data-number]"));
  if (sign) pick(Number(sign.dataset.number));
});

find("#probe-lead").textContent = "Pick a sign, then the square that you think it tells. You may leave signs out.";
for (const item of form.items) item.hidden = true;
board.append(picture);
area.append(board);
form.element.append(told, eraser, panel, el("div", { class: "keys digits" }, ...keys));
area.hidden = false;
draw();
startBar();
watchWindow(data.events_url, data.page);
