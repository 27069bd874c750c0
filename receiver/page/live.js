/**
 * A live programme in the video element: fragments from a WebSocket through Media Source Extensions.
 *
 * Holes of the broadcast are jumped over; a page that fell behind catches up; what lies a minute
 * back is forgotten.
 */

const KEPT_S = 60;
const BEHIND_S = 6;
const EDGE_S = 1.2;
const RETRY_MS = 1000;

export class LiveProgramme {
  constructor(video, url) {
    this.video = video;
    this.url = url;
    this.waiting = [];
    this.media = new MediaSource();
    this.buffer = null;
    video.src = URL.createObjectURL(this.media);
    this.media.addEventListener("sourceopen", () => this.connect(), { once: true });
    setInterval(() => this.keepUp(), 250);
  }

  connect() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => {
      this.waiting.push(typeof event.data === "string" ? JSON.parse(event.data) : event.data);
      this.append();
    };
    socket.onclose = () => setTimeout(() => this.connect(), RETRY_MS);
  }

  /** Hand the next waiting piece to the browser. */
  append() {
    if (!this.waiting.length || (this.buffer && this.buffer.updating)) return;
    const next = this.waiting.shift();
    if (next instanceof ArrayBuffer) this.buffer.appendBuffer(next);
    else {
      this.prepare(next.mime);
      this.append();
    }
  }

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
    let next = null;
    for (let i = 0; i < buffered.length; i++) {
      if (buffered.start(i) <= video.currentTime && video.currentTime < buffered.end(i) - 0.05) inside = true;
      else if (next === null && buffered.start(i) > video.currentTime) next = buffered.start(i);
    }
    if (!inside && next !== null) video.currentTime = next + 0.01;
    else if (!video.paused && end - video.currentTime > BEHIND_S) video.currentTime = end - EDGE_S;
    if (video.currentTime - buffered.start(0) > 2 * KEPT_S && !buffer.updating) {
      buffer.remove(0, video.currentTime - KEPT_S);
    }
  }
}
