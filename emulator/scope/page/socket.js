// The page's socket: JSON, MAVLink and traces, connected anew whenever it breaks.

import { decode, encode } from "./mavlink.js";

const MAVLINK = 0;
const AGAIN_MS = 1000;

/** Calls `handlers` by what comes: open, close, mavlink, trace, and the names of JSON messages. */
export class Link {
  constructor(handlers) {
    this.handlers = handlers;
    /** The ESC that is looked at, from 0. */
    this.esc = 0;
    this.connect();
  }

  connect() {
    const url = new URL(`socket${location.search}`, location.href);
    url.protocol = "ws:";
    this.socket = new WebSocket(url);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.handlers.open();
    this.socket.onclose = () => {
      this.handlers.close();
      setTimeout(() => this.connect(), AGAIN_MS);
    };
    this.socket.onmessage = ({ data }) => this.take(data);
  }

  take(data) {
    if (typeof data === "string") {
      for (const [name, content] of Object.entries(JSON.parse(data))) this.handlers[name]?.(content);
    } else if (new Uint8Array(data, 0, 1)[0] === MAVLINK) {
      for (const message of decode(new Uint8Array(data, 1))) this.handlers.mavlink(message);
    } else {
      this.handlers.trace(data);
    }
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  ask(what) {
    if (this.isOpen) this.socket.send(JSON.stringify(what));
  }

  mavlink(name, message) {
    if (!this.isOpen) return;
    const frame = encode(name, message);
    const bytes = new Uint8Array(frame.length + 1);
    bytes[0] = MAVLINK;
    bytes.set(frame, 1);
    this.socket.send(bytes);
  }
}
