// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { nodes } from "../../static/js/board/drawing.js";
import { cellAt, centre, markBoard } from "../../static/js/board/grid.js";
import { Marks } from "../../static/js/lib/marks.js";

test("a sign is picked, the cursor moved and kept on the board, and the square marked", () => {
  const marks = new Marks([1, 2], 3);
  assert.equal(marks.mark(), null, "no sign is picked");
  assert.equal(marks.pick(7), false);
  assert.equal(marks.pick(2), true);
  for (const key of /** @type {const} */ (["up", "up", "up", "left"])) assert.equal(marks.move(key), true);
  assert.equal(marks.move("go"), false);
  assert.equal(marks.mark(), 2);
  assert.deepEqual([marks.value(2), marks.value(1)], ["0,0", ""]);
});

test("each sign has one mark: a second one moves it, and it can be taken away", () => {
  const marks = new Marks([4], 9);
  marks.pick(4);
  marks.mark();
  marks.move("right");
  marks.mark();
  assert.deepEqual(marks.all(), [{ number: 4, cell: [4, 5] }]);
  assert.equal(marks.erase(), 4);
  assert.equal(marks.erase(), null);
  assert.equal(marks.value(4), "");
});

test("picking a sign that is marked brings the cursor to its mark; the next one is the first without", () => {
  const marks = new Marks([3, 5], 9);
  marks.restore(3, "8,0");
  assert.equal(marks.next, 5);
  marks.pick(3);
  assert.deepEqual(marks.cursor, [8, 0]);
});

test("an answer that is no cell of the board is no mark", () => {
  const marks = new Marks([1], 9);
  for (const odd of ["", "9,0", "0,9", "-1,2", "1", "1,2,3", "a,b", "1.5,2"]) marks.restore(1, odd);
  assert.deepEqual(marks.all(), []);
});

test("the cell under the pointer is the cell whose square is drawn there", () => {
  for (const cell of /** @type {[number, number][]} */ ([
    [0, 0],
    [4, 7],
    [8, 8],
  ])) {
    const { x, y } = centre(9, cell);
    assert.deepEqual(cellAt(9, { x: x / 490, y: y / 490 }), cell);
  }
  assert.deepEqual(cellAt(9, { x: -1, y: 2 }), [8, 0], "outside: the nearest");
});

test("signs in the same square stand beside each other, and the label tells what the picture shows", () => {
  const marks = [
    { number: 1, cell: /** @type {[number, number]} */ ([2, 2]) },
    { number: 6, cell: /** @type {[number, number]} */ ([2, 2]) },
  ];
  const drawn = markBoard({ size: 9, marks, picked: 6, cursor: [2, 2] });
  const places = [...nodes(drawn)]
    .map((node) => String(node.attributes.transform ?? ""))
    .filter((t) => /scale/.test(t));
  assert.equal(new Set(places).size, 2);
  assert.match(String(drawn.attributes["aria-label"]), /Sign 1 at row 3, column 3\. Sign 6 at row 3, column 3\./);
});
