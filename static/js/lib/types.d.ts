/** What a browser gets and sends during a round (docs: the HTTP contract of the play API). */

export type Cell = [row: number, column: number];

export interface Sign {
  /** The number on screen; a name without meaning. */
  number: number;
  /** Place on the plane, 0 to 1. */
  x: number;
  y: number;
}

interface ViewBase {
  round: number;
  seq: number;
  phase: "practice" | "main";
  number: number;
  of: number;
  block: number;
  limit: number;
  step: number;
  actions: number[];
  over: Over | null;
}

export interface Over {
  outcome: "found" | "not_found" | "arrived" | "collision" | "limit" | "abandoned";
  last: boolean;
  child?: Cell;
}

export interface ParentView extends ViewBase {
  task: "parent_child";
  role: "parent";
  size: number;
  vision: number;
  cell: Cell;
  trail: Cell[];
  child: Cell | null;
  sign: number | null;
  signs: Sign[];
  blank: boolean;
}

export interface ChildView extends ViewBase {
  task: "parent_child";
  role: "child";
  size: number;
  vision: number;
  cell: Cell;
  parent: Cell | null;
  sign: number | null;
  signs: Sign[];
  blank: boolean;
  /** After the choice: every cell the parent stood on, the start included. */
  walk?: Cell[];
}

export interface DriverView extends ViewBase {
  task: "traffic_junction";
  role: "driver";
  size: number;
  cell: Cell;
  heading: "up" | "right" | "down" | "left";
  route: Cell[];
  position: number;
  triangles: [row: number, column: number, likelihood: number][];
  /** Only in the answer that opens the round. */
  roads?: Roads;
}

export interface Roads {
  rows: number[];
  columns: number[];
}

export type RoundView = ParentView | ChildView | DriverView;

/** What `decide` may add to the view that it brings back. */
export interface Brought {
  /** The wait was no ordinary one (reload, lost connection, another tab): the next time is flagged. */
  resumed?: boolean;
  /** Said instead of the prompt, once. */
  notice?: Message;
}

export interface Timing {
  onset_ms: number;
  response_ms: number;
  rt_ms: number;
  handler_lag_ms: number;
  wait_ms: number | null;
  is_trusted: boolean;
  hidden: boolean;
  resumed: boolean;
  refresh_hz: number | null;
  dropped_frames: number;
  board_px: number;
  early_keys: number;
  input: "key" | "click";
}

/** Sends a decision about `view` and brings the view that follows; null: this page has no part in it any more. */
export type Decide<View extends RoundView> = (
  action: number,
  timing: Timing,
  view: View,
) => Promise<(View & Brought) | null>;

/** One line for the strip below the board. */
export interface Message {
  kind?: "plain" | "good" | "bad" | "warn";
  icon?: string;
  title?: string;
  text?: string;
  /** A quiet word at the end, before the button. */
  aside?: string;
  button?: { label: string; key?: string; primary?: boolean; press: (event: Event) => void };
}

export interface Clock {
  /** Milliseconds on the same axis as an event's timeStamp. */
  now(): number;
  /** Calls back at the next frame with that frame's time. */
  frame(callback: (time: number) => void): void;
}

/** A node of a drawing, before it is DOM. */
export interface Drawing {
  tag: string;
  attributes: Record<string, string | number>;
  children: (Drawing | string)[];
}
