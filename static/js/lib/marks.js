// @ts-check
// Marking where signs point: one sign in the hand, one cell under the cursor, one mark a sign at most. Pure.

/** @import { Cell } from "./types.js" */
/** @import { KeyName } from "./keys.js" */

/** @type {Partial<Record<KeyName, Cell>>} */
const MOVES = { up: [-1, 0], right: [0, 1], down: [1, 0], left: [0, -1] };

export class Marks {
  /** @type {Map<number, Cell>} */ #cells = new Map();
  /** The sign that the next mark is for. @type {number | null} */ picked = null;
  /** @type {Cell} */ cursor;

  /**
   * @param {number[]} numbers of the signs
   * @param {number} size of the board
   */
  constructor(numbers, size) {
    this.numbers = numbers;
    this.size = size;
    this.cursor = [Math.floor(size / 2), Math.floor(size / 2)];
  }

  /** @param {number} number @returns {boolean} whether there is such a sign */
  pick(number) {
    if (!this.numbers.includes(number)) return false;
    this.picked = number;
    this.cursor = this.#cells.get(number) ?? this.cursor;
    return true;
  }

  /** @param {KeyName | null} key @returns {boolean} whether it moves the cursor */
  move(key) {
    const by = key === null ? undefined : MOVES[key];
    if (!by) return false;
    const inside = (/** @type {number} */ at) => Math.min(this.size - 1, Math.max(0, at));
    this.cursor = [inside(this.cursor[0] + by[0]), inside(this.cursor[1] + by[1])];
    return true;
  }

  /** The picked sign is marked at the cursor, and nowhere else any more. @returns {number | null} the sign */
  mark() {
    if (this.picked !== null) this.#cells.set(this.picked, this.cursor);
    return this.picked;
  }

  /** Takes the mark of the picked sign away. @returns {number | null} the sign, if it had one */
  erase() {
    return this.picked !== null && this.#cells.delete(this.picked) ? this.picked : null;
  }

  /** @param {number} number */
  cellOf(number) {
    return this.#cells.get(number) ?? null;
  }

  /**
   * As the server stores it; empty: no mark.
   * @param {number} number
   */
  value(number) {
    return this.#cells.get(number)?.join(",") ?? "";
  }

  /**
   * Takes up a mark from an earlier answer; anything else is no mark.
   * @param {number} number
   * @param {string} value
   */
  restore(number, value) {
    const [row, column, ...more] = value.split(",").map((part) => (/^\d{1,2}$/.test(part) ? Number(part) : Number.NaN));
    if (row === undefined || column === undefined || more.length > 0) return;
    if (row < this.size && column < this.size) this.#cells.set(number, [row, column]);
  }

  /** @returns {{ number: number, cell: Cell }[]} */
  all() {
    return [...this.#cells].map(([number, cell]) => ({ number, cell }));
  }

  /** The first sign without a mark, in the order of the numbers. */
  get next() {
    return this.numbers.find((number) => !this.#cells.has(number)) ?? null;
  }
}
