/**
 * The WebSocket from the receiver: status, keys and motion, decoded and handed on.
 *
 * Binary message, little endian: u8 kind (1), u8 layers (bit 0 L0, bit 1 L1, bit 7 concealed),
 * u16 count, u16 width, u16 epoch, f64 start in seconds, f32 rate in Hz, then count x width f32.
 */

const HEADER_BYTES = 20;
const RETRY_MS = [500, 1000, 2000, 4000];
const FULL = 4001;

export class Feed {
  /** @type {any} A WebSocket, there from the first call of `connect` on. */
  socket;

  /**
   * `handlers`: motion(piece), message(document), open(), closed(full): whether too many pages are watching.
   * @param {string} url @param {FeedHandlers} handlers
   */
  constructor(url, handlers) {
    this.url = url;
    this.handlers = handlers;
    this.attempt = 0;
    this.connect();
  }

  connect() {
    this.socket = new WebSocket(this.url);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.handlers.open();
    this.socket.onmessage = (/** @type {MessageEvent} */ event) => {
      this.attempt = 0;
      this.receive(event.data);
    };
    this.socket.onclose = (/** @type {CloseEvent} */ event) => {
      this.handlers.closed(event.code === FULL);
      const wait = RETRY_MS[Math.min(this.attempt++, RETRY_MS.length - 1)];
      setTimeout(() => this.connect(), wait);
    };
  }

  /** @param {string|ArrayBuffer} data */
  receive(data) {
    if (typeof data === "string") this.handlers.message(JSON.parse(data));
    else this.handlers.motion(parseMotion(data));
  }

  /** Tell the receiver where the viewer is. @param {number} timeS @param {boolean} jumped */
  position(timeS, jumped) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ type: "position", time_s: Math.round(timeS * 1000) / 1000, jumped }));
  }
}

/** Decode a motion message. @param {ArrayBuffer} buffer */
export function parseMotion(buffer) {
  const view = new DataView(buffer);
  const count = view.getUint16(2, true);
  const width = view.getUint16(4, true);
  if (view.getUint8(0) !== 1 || buffer.byteLength !== HEADER_BYTES + 4 * count * width) {
    throw new Error(`motion message of ${buffer.byteLength} bytes is malformed`);
  }
  return {
    layers: view.getUint8(1) & 0x7f,
    concealed: (view.getUint8(1) & 0x80) !== 0,
    count,
    width,
    epoch: view.getUint16(6, true),
    startS: view.getFloat64(8, true),
    rateHz: view.getFloat32(16, true),
    frames: new Float32Array(buffer, HEADER_BYTES),
  };
}
