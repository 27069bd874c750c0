/**
 * The stream file beside a programme: its cuer without the programme's sound, on the media's clock.
 * It is fetched whole and decoded in the worker some way ahead of the viewer, at any speed.
 */

const AHEAD_S = 30;
const REFILL_S = 15;
const BEFORE_S = 5;
/** As far behind the viewer the page's timeline remembers. */
const KEPT_S = 290;

/**
 * Where the stream file of `media` is: `named`, or the programme's address with `.cue` at its end; "" if nowhere.
 * @param {HTMLMediaElement} media @param {string|null} named
 */
export function sidecarAddress(media, named) {
  if (named) return new URL(named, document.baseURI).href;
  const address = media.currentSrc || media.src;
  if (!/^https?:/.test(address)) return "";
  const url = new URL(address);
  url.search = url.hash = "";
  url.pathname = url.pathname.replace(/(\.[^./]*)?$/, ".cue");
  return url.href;
}

export class Sidecar {
  /**
   * Fetch and open a stream file; rejects if there is none or it cannot be read.
   * @param {HTMLMediaElement} media @param {string} address @param {PlayerFiles} files
   * @param {HearingHandlers} handlers
   */
  static async open(media, address, files, handlers) {
    if (!address) throw new Error("the programme has no address of its own");
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
    const sidecar = new Sidecar(media, files, handlers);
    try {
      await sidecar.load(await answer.arrayBuffer());
    } catch (error) {
      sidecar.close();
      throw error;
    }
    return sidecar;
  }

  /** @param {HTMLMediaElement} media @param {PlayerFiles} files @param {HearingHandlers} handlers */
  constructor(media, { module, voice, worker }, handlers) {
    this.media = media;
    this.handlers = handlers;
    this.worker = new Worker(worker, { type: "module" });
    this.worker.postMessage({ type: "open", module, voice, rateHz: 48000, channels: 2 });
    /** Known, and asked for, from here to there: seconds of the programme. */
    this.fromS = 0;
    this.untilS = -Infinity;
  }

  /** @param {ArrayBuffer} bytes */
  load(bytes) {
    return new Promise((resolve, reject) => {
      this.worker.onerror = (event) => reject(new Error(event.message));
      this.worker.onmessage = ({ data }) => {
        if (data.type === "failed") reject(new Error(data.text));
        else if (data.type === "opened") resolve(data);
        else this.handlers.heard(data, 0);
      };
      this.worker.postMessage({ type: "file", bytes }, [bytes]);
    });
  }

  /** Have what the viewer needs next decoded; call at each refresh. */
  tick() {
    const { currentTime } = this.media;
    this.fromS = Math.max(this.fromS, currentTime - KEPT_S);
    const anew = currentTime < this.fromS;
    if (!anew && currentTime + REFILL_S < this.untilS) return;
    const gone = anew || currentTime > this.untilS;
    if (gone) this.fromS = Math.max(0, currentTime - BEFORE_S);
    this.untilS = currentTime + AHEAD_S;
    this.worker.postMessage({ type: "read", anew, fromS: this.fromS, untilS: this.untilS });
  }

  close() {
    this.worker.terminate();
  }
}
