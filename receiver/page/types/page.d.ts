/**
 * The data that the page's scripts pass to each other, for the type checker: nothing of this file
 * is sent to a browser. Times are seconds, lengths millimetres unless a name says otherwise.
 */

type Numbers = ArrayLike<number> & Iterable<number>;
type TypedArray = Float32Array | Int16Array | Uint16Array | Uint8Array;
/** Arrays of `/avatar.bin` by name. */
type Arrays = Record<string, TypedArray>;
type Words = Record<string, string>;

/** CSS pixels. */
interface Box { left: number; top: number; width: number; height: number }
interface Size { width: number; height: number }
/** Letters of the line of keys (CSS pixels), and how many keys stand on each side of the present one. */
interface KeyLine { size: number; around: number }
interface KeyBand extends KeyLine { height: number }

/** What the layout depends on; `captions`: letters in percent of the screen's smaller side. */
interface LayoutChoice {
  layout: string; size: string; place: string; left: number; top: number; width: number; keys: boolean; captions: number;
}
/** The viewer's choices by name, as `settings.js` checks them. */
type Values = any;
interface StageChoice extends LayoutChoice { contrast: string; opacity: number; ground: string }
interface Layout { kind: string; cuer: Box; keys: Box & KeyLine; programme: Box; captions: Box; bar: Box; panel: Box }

/** How she is drawn: `alpha` 0 to 1, `dot` the radius of a point in percent of the picture's height. */
interface Look { alpha: number; dot: number; mirror: boolean; handOnly: boolean; contrast: string }
/** The viewer's choices of it: `opacity` and `dot` in percent. */
interface LookChoice { opacity: number; dot: number; mirror: boolean; handOnly: boolean; contrast: string }

interface Key { start: number; end: number; shape: number; placement: string; phones: string[] }
interface Stroke { shape: number; placement: string; leave: number; reach: number }
interface HandKey { shape: number; placement: string }
/** Frames of motion; bits 0 and 1 of `layers` stand for L0 and L1. */
interface Piece {
  startS: number; rateHz: number; count: number; width: number; frames: Float32Array; concealed: boolean; layers: number; epoch?: number;
}
/** Writes the parameters of a time; returns 0 where none are known. */
type Sample = (timeS: number, out: Float64Array) => number;
interface StateChange { time_s: number; state: string }
/** Who speaks through the cuer, as far as it is known. */
interface Whose { status: string; of: string; age_s?: number; timeS?: number }

interface Camera { centre: number[]; height_mm: number; distance_mm: number }
/** Constants of `codec.cuer.movement`; `places`: where the hand is for each key. */
interface HandMovement {
  places: number[][]; rest_gap_s: number; first_lead_s: number; lag_share: number; hurried_s: number; most_lead_s: number;
  lead_s_per_mm: number; lead_share: number; calm_share: number; least_lead_s: number; fastest_m_s: number; late_s: number;
  shortest_s: number; rest_delay_s: number; rest_move_s: number; overlap: number;
}
/** A wave: size, period in seconds, phase in turns. */
type Wave = number[];
/** The table of `receiver.drawing.movement`. */
interface Rules {
  taps: number; step_s: number; hand_s: number[]; mouth_s: number[]; signals: number[][];
  breath: number[]; breath_wave: Wave; trunk_waves: Wave[][]; trunk_raised_mm: number[]; trunk_breath_mm: number[]; lean_mm: number;
  nod: { per_mm: number; onset: number; end: number; most_rad: number }; resting_share: number; head_waves: Wave[][];
  fixation_s: number; saccade_s: number; wander_rad: number[][]; lens_rad: number[];
  blink_s: number[]; blink_slot_s: number; blink_after_s: number; lids_rest: number; lids_per_rad: number;
  knit_wave: Wave; brow_onset: number; brow_per_mm: number; squint: number[]; cheek_per_mm: number; wide_onset: number;
  shoulder: number[]; shoulder_breath_mm: number; shoulder_most_mm: number; neck_mm: number[]; throat: number[][];
}
/** The document `/voice.json`; matrices are base64 of float64, row by row. */
interface VoiceDocument {
  identity: string; layout: string[]; markers: string[]; face_markers: number; pointing: string[]; looks?: string[];
  camera: Camera; aspect: number; movement: HandMovement; rules: Rules;
  gestures: Words; face: Words; hand: Words;
}
/** What the rules add to the parameters on air; `shapes`: weights of blend shapes. */
interface Added { shapes: Record<string, number>; gaze: number[]; nod: number[]; trunk: number[]; breath: number }
/** A map of points: nine numbers row by row, then a shift. */
interface RigidMap { turn: Numbers; shift: number[] }
interface Pose {
  head: number[]; hand: number[]; joints: RigidMap[]; shapes: Record<string, number>; gaze: number[]; trunk: number[]; pivots: Numbers[];
}
/** Decoded matrices of the voice by name. */
type Matrices = Record<string, Float64Array>;
type Model = import("../model.js").VoiceModel;

/** A compiled program of WebGL, its attributes and uniforms by name. */
interface Program { handle: WebGLProgram; attributes: Record<string, number>; uniforms: Record<string, WebGLUniformLocation | null> }
type GL = WebGLRenderingContext | WebGL2RenderingContext;
/** First index and number of indices. */
type Indices = number[];
/** Head or hand in the graphics memory. */
interface Uploaded {
  surface: import("../avatar.js").Surface; buffers: WebGLBuffer[]; position: WebGLBuffer; normal: WebGLBuffer; colour: WebGLBuffer;
  extra: WebGLBuffer; index: WebGLBuffer; opaque: Indices; clear: Indices;
}
/** What the page does with messages of the receiver; `full`: whether too many pages are watching. */
interface FeedHandlers { motion(piece: Piece): void; message(document: any): void; open(): void; closed(full: boolean): void }

/** Files of the player, and the broadcaster's public file that its page trusts. */
interface PlayerFiles { module: ArrayBuffer; voice: ArrayBuffer; worklet: URL; worker: URL; trust: { announcement?: ArrayBuffer; toleranceS?: number } }
/** What the player does with decoded sound; `offsetS` leads to the media's time. */
interface HearingHandlers { heard(message: any, offsetS: number): void; reason(name: string, text?: string): void }
/** Frames of motion that belong together. */
interface Rows { startS: number; layers: number; rows: Float32Array[] }
/** What the decoder hears. */
interface DecoderConfig { rateHz: number; channels: number; startS?: number; history?: boolean }

/** What is practised: its keys, and where its phrases begin. */
interface Item { keys: Key[]; phrases: number[] }
/** How a practice item is played. */
interface PlayOptions { from?: number; until?: number; loop?: boolean; sound?: HTMLMediaElement | null }
/** How far a participant is, and a step of his test. */
interface Progress { code: string; next: number; steps: number; ended: boolean }
interface Step {
  step: number; moves: boolean; display: string; sound: boolean; prompt: string; choices: string[]; captions: [number, number, string][];
}

type PageStage = import("../stage.js").Stage;
type PageSettings = import("../settings.js").Settings;
