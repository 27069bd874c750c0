/**
 * The programme's clock as the viewer sees it: the media time of the picture that the next
 * refresh of the screen shows.
 *
 * While the video plays, presented frames tell their media time and the instant at which they
 * appear; between them the clock runs at the playback rate. Without such frames (paused, no
 * picture, an old browser) it is `currentTime`.
 */

const STALE_MS = 250;

export class ProgrammeClock {
  constructor(video) {
    this.video = video;
    this.frame = null;
    for (const name of ["seeking", "pause", "ratechange", "emptied"]) {
      video.addEventListener(name, () => { this.frame = null; });
    }
    if (video.requestVideoFrameCallback) this.follow();
  }

  follow() {
    this.video.requestVideoFrameCallback((now, metadata) => {
      if (!this.video.paused && !this.video.seeking) {
        this.frame = { mediaS: metadata.mediaTime, shownMs: metadata.expectedDisplayTime };
      }
      this.follow();
    });
  }

  /** Media time in seconds at `nowMs` on the page's clock. */
  at(nowMs) {
    const { video, frame } = this;
    if (!frame || video.paused || video.seeking || nowMs - frame.shownMs > STALE_MS) return video.currentTime;
    return frame.mediaS + Math.max(0, nowMs - frame.shownMs) / 1000 * video.playbackRate;
  }
}
