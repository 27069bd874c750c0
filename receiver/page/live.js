/**
 * A live programme in the video element: fragments from a WebSocket through Media Source Extensions.
 *
 * At the start, and after the media ran dry, pieces are kept back for a second: as much as the line
 * may be late from then on. Holes of the broadcast are jumped over; a page that fell behind
 * catches up; what lies a minute back is forgotten.
 */

const KEPT_S = 60;
const BEHIND_S = 6;
const CUSHION_S = 1;
const RETRY_MS = 1000;
const LOOK_MS = 250;
const PATIENCE_MS = 3000;

export class LiveProgramme {
  /**
   * `tell(start)` hears of each new run of media: `{recoded, unseen}`, names of codecs or empty.
   * @param {HTMLVideoElement} video @param {string} url
   * @param {(beginning: {recoded: string, unseen: string}) => void} tell
   */
  constructor(video, url, tell) {
    this.tell = tell;
    this.video = video;
    this.url = url;
    /** @type {any[]} */
    this.waiting = [];
    this.media = new MediaSource();
    /** @type {any} */
    this.buffer = null;
    this.openMs = Infinity;
    this.outsideMs = 0;
    video.src = URL.createObjectURL(this.media);
    this.media.addEventListener("sourceopen", () => this.connect(), { once: true });
    video.addEventListener("waiting", () => this.runDry());
    setInterval(() => this.keepUp(), LOOK_MS);
  }

  connect() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => {
      this.waiting.push(typeof event.data === "string" ? JSON.parse(event.data) : event.data);
      if (this.openMs === Infinity) this.keepBack();
      this.append();
    };
    socket.onclose = () => setTimeout(() => this.connect(), RETRY_MS);
  }

  /** Let pieces wait until the cushion is full. */
  keepBack() {
    this.openMs = performance.now() + 1000 * CUSHION_S;
    setTimeout(() => this.append(), 1000 * CUSHION_S + 1);
  }

  /** The browser waits for media: fill the cushion again, unless there is more behind a hole. */
  runDry() {
    const { video, buffer } = this;
    if (!buffer || video.seeking || !buffer.buffered.length) return;
    if (buffer.buffered.end(buffer.buffered.length - 1) - video.currentTime < 0.2) this.keepBack();
  }

  /** Hand the next waiting piece to the browser. */
  append() {
    if (performance.now() < this.openMs || !this.waiting.length) return;
    if (this.buffer && this.buffer.updating) return;
    const next = this.waiting.shift();
    if (next instanceof ArrayBuffer) this.buffer.appendBuffer(next);
    else {
      this.prepare(next.mime);
      this.tell(next);
      this.append();
    }
  }

  /** @param {string} mime */
  prepare(mime) {
    if (this.buffer) {
      this.buffer.changeType(mime);
      return;
    }
    this.buffer = this.media.addSourceBuffer(mime);
    this.buffer.addEventListener("updateend", () => this.append());
  }

  /** Jump into the buffered media, over its holes, and near its end. */
  keepUp() {
    const { video, buffer } = this;
    if (!buffer || !buffer.buffered.length) return;
    const { buffered } = buffer;
    const end = buffered.end(buffered.length - 1);
    let inside = false;
    let next = Infinity;
    for (let i = 0; i < buffered.length; i++) {
      if (buffered.start(i) <= video.currentTime && video.currentTime < buffered.end(i) - 0.05) inside = true;
      else if (next === Infinity && buffered.start(i) > video.currentTime) next = buffered.start(i);
    }
    this.outsideMs = inside ? 0 : this.outsideMs + LOOK_MS;
    const enough = end - next >= CUSHION_S || this.outsideMs > PATIENCE_MS;
    if (!inside && next < Infinity && enough) video.currentTime = next + 0.01;
    else if (!video.paused && end - video.currentTime > BEHIND_S) video.currentTime = end - CUSHION_S;
    if (video.currentTime - buffered.start(0) > 2 * KEPT_S && !buffer.updating) {
      buffer.remove(0, video.currentTime - KEPT_S);
    }
  }
}
