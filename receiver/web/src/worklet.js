/**
 * Hears what the page plays: collects samples of both channels and sends them to the decoder's
 * worker with the time of the first one. Changes nothing; has no imports, as worklets may not.
 */

const FRAMES = 2048;
const CHANNELS = 2;

class CuecastHearing extends AudioWorkletProcessor {
  constructor() {
    super();
    this.sink = null;
    this.clear();
    this.port.onmessage = ({ data }) => { this.sink = data; };
  }

  clear() {
    this.planes = Array.from({ length: CHANNELS }, () => new Float32Array(FRAMES));
    this.count = 0;
    this.timeS = currentTime;
  }

  process([input]) {
    if (this.count === 0) this.timeS = currentTime;
    const length = input.length ? input[0].length : 128;
    this.planes.forEach((plane, channel) => {
      const samples = input[Math.min(channel, input.length - 1)];
      if (samples) plane.set(samples, this.count);
    });
    this.count += length;
    if (this.count >= FRAMES) {
      const { planes, timeS } = this;
      if (this.sink) this.sink.postMessage({ timeS, planes }, planes.map((plane) => plane.buffer));
      this.clear();
    }
    return true;
  }
}

registerProcessor("cuecast-hearing", CuecastHearing);
