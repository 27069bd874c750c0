/**
 * The programme's clock as the viewer sees it: the media time of the picture that stands on the
 * screen when what is drawn now appears there, one refresh later.
 *
 * While the video plays, presented frames tell their media time and the instant at which they
 * appear; between them the clock runs at the playback rate. When frames fail to come it goes on
 * with `currentTime`, which stands still when the media ran dry, and keeps the distance that both
 * had before. Without any frames (paused, no picture, an old browser) it is `currentTime`.
 */

const STALE_MS = 80;
const DISTANCE_SHARE = 0.1;
const USUAL_REFRESH_MS = 1000 / 60;
const FASTEST_REFRESH_MS = 4;

export class ProgrammeClock {
  /** @param {HTMLVideoElement} video */
  constructor(video) {
    this.video = video;
    /** @type {{mediaS: number, shownMs: number} | null} */
    this.frame = null;
    this.distanceS = 0;
    this.refreshMs = USUAL_REFRESH_MS;
    this.beforeMs = NaN;
    for (const name of ["seeking", "pause", "ratechange", "emptied"]) {
      video.addEventListener(name, () => this.forget());
    }
    if ("requestVideoFrameCallback" in video) this.follow();
  }

  forget() {
    this.frame = null;
    this.distanceS = 0;
  }

  follow() {
    this.video.requestVideoFrameCallback((now, metadata) => {
      if (!this.video.paused && !this.video.seeking) {
        this.frame = { mediaS: metadata.mediaTime, shownMs: metadata.expectedDisplayTime };
      }
      this.follow();
    });
  }

  /** Media time in seconds for what is drawn at `nowMs`, the page's time of this refresh. @param {number} nowMs */
  at(nowMs) {
    const { video, frame } = this;
    const step = nowMs - this.beforeMs;
    this.beforeMs = nowMs;
    // Late refreshes take several periods: only the shorter ones say what the period is.
    if (step > FASTEST_REFRESH_MS && step < 1.5 * this.refreshMs) this.refreshMs += 0.1 * (step - this.refreshMs);
    if (!frame || video.paused || video.seeking) return video.currentTime;
    const agoMs = nowMs - frame.shownMs;
    if (agoMs > STALE_MS) return video.currentTime + this.distanceS;
    const timeS = frame.mediaS + Math.max(0, agoMs + this.refreshMs) / 1000 * video.playbackRate;
    this.distanceS += DISTANCE_SHARE * (timeS - video.currentTime - this.distanceS);
    return timeS;
  }
}
