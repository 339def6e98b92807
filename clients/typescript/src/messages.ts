/**
 * The JSON messages of /v1/live, made by `uv run python bench/typescript_types.py`.
 * docs/asyncapi.json has ranges and units, docs/websocket.md what they mean together.
 */

/** What the rig made of a scene; nothing is scaled in silence. */
export interface Applied {
  gain: number;
  feasible_gain: number;
  bias: number;
  bias_n: number;
  scaled: boolean;
  speed_range_mm_s: [number, number];
  notes: Array<string>;
}

/** The page holds the rig. */
export interface Armed {
  op: "armed";
  rig: string;
  id: number | null;
}

/** One channel of a rig's stream `aux`. */
export interface AuxChannel {
  name: string;
  unit: string;
}

/** Measured friction over what the model in force predicts, in a band of a sixth octave. */
export interface BandRatio {
  centre_hz: number;
  ratio_db: number;
  half_width_db: number;
}

/** Amplitude ``scale BetaPDF(x; alpha, beta)``, ``x = log10(f/20) / log10(50)``. */
export interface Beta {
  kind: "beta";
  alpha: number;
  beta: number;
  rms_n: number;
  scale?: number;
  seed?: number;
  speed_mm_s?: number | null;
  angle_deg?: number;
}

/** End the texture stream; the rig fades to the scene. */
export interface CloseStream {
  op: "close_stream";
  id?: number | null;
}

/** What is inverted between the friction that is asked for and the drive. */
export interface Compensation {
  mode: "model" | "fixed" | "none";
  speed_mm_s: number | null;
}

/** One sinusoid, ``amplitude_n cos(2 pi f t + phase_rad)``, over position or time. */
export interface Component {
  amplitude_n: number;
  cycles_per_mm?: number | null;
  hz?: number | null;
  phase_rad?: number;
}

/** Counts since the rig started; they only grow. */
export interface Counters {
  blocks: number;
  deadline_misses: number;
  overruns: number;
  underruns: number;
  clipped_samples: number;
  extrapolated_samples: number;
  scaled_scenes: number;
  stale_touches: number;
  refused_commands: number;
  stream_updates: number;
  stream_updates_expired: number;
  blocks_published: number;
  blocks_dropped: number;
  lead_growths: number;
  trips: number;
}

/** Covariance of the base parameters, in the order and units of `parameters`. */
export interface Covariance {
  parameters: Array<string>;
  matrix: Array<Array<number>>;
}

/** The page holds the rig no more. */
export interface Disarmed {
  op: "disarmed";
  rig: string;
  reason: string;
  by: string | null;
  utc_ns: number | null;
  id: number | null;
}

/** An effect that extends the base law; ids are open strings on the wire. */
export interface Effect {
  id: string;
  parameters: Record<string, number>;
}

/** What is known of the finger on the screen while any texture plays. */
export interface EstimateState {
  utc_ns: number;
  run: number;
  participant: string | null;
  windows: number;
  refused: Record<string, number>;
  new_fingers: number;
  model_etag: string;
  law: LawNow | null;
  model: Model | null;
  in_force: LawValues | null;
  points: Array<ResponsePoint>;
  bands: Array<BandRatio>;
  error_db: Record<string, number>;
  gain_nats: Record<string, number>;
  evidence: Record<string, number>;
  alarm_nats: number;
  alarms: Array<string>;
  advice: Record<string, string>;
  policy: "observe" | "suggest" | "adapt";
  held_back: string;
  changes: Array<ModelChange>;
}

/** A drive played as it is, without the inverse of any model: for calibration. */
export interface Excitation {
  tones: Array<Tone>;
  bias: number;
  period_s: number | null;
}

/** A typed fault, as `docs/safety.md` lists them. */
export interface Fault {
  kind: "config" | "transient" | "stream_lost" | "device_lost" | "link_lost" | "sensor" | "safety" | "deadline" | "internal";
  reason: string;
  utc_ns: number;
  action: string;
}

/** Where the finger is and how it moves, as the sensors say it. */
export interface FingerState {
  sequence: number;
  sample: number;
  utc_ns: number;
  uncertainty_ns: number;
  x_mm: number;
  y_mm: number;
  vx_mm_s: number;
  vy_mm_s: number;
  normal_force_n: number;
  in_contact: boolean;
  source: "touch" | "pointer" | "simulated";
  age_ms: number;
  stale: boolean;
  extrapolated: boolean;
}

/** Friction response ``g w0 / (s + w0)``, ``w0 = 2 pi (cutoff_0 + slope |v|)``. */
export interface FirstOrderSpeedLaw {
  law: "first_order_speed";
  gain_n: number;
  cutoff_0_hz: number;
  slope_hz_per_mm_s: number;
}

/** What a participant is asked to do, and does; a screen shows it while calibrating. */
export interface GuidanceState {
  utc_ns: number;
  participant: string;
  phase: "break" | "approach" | "record" | "analyse" | "done";
  trial: number;
  trials: number | null;
  seconds_left: number;
  target_speed_mm_s: number;
  target_force_n: number;
  reference_x_mm: number;
  span_mm: [number, number];
  x_mm: number | null;
  speed_mm_s: number | null;
  force_n: number | null;
  colour: "green" | "yellow" | "red" | "grey";
  message: string;
}

/** The first message: who asks. It is the only one with a token. */
export interface Hello {
  op: "hello";
  version: 1;
  token?: string | null;
  page?: "participant" | null;
}

/** A value and its central 95 % interval. */
export interface Interval {
  value: number;
  low: number;
  high: number;
}

/** Who last had a call of a name accepted. */
export interface LastCall {
  client: string;
  utc_ns: number;
}

/** The law of the finger on the screen; a cutoff between the two is a straight line. */
export interface LawNow {
  gain_n: Interval;
  cutoff_20_hz: Interval;
  cutoff_100_hz: Interval;
  delay_us: Interval;
}

/** A law without intervals: of a model that is, or was, in force. */
export interface LawValues {
  gain_n: number;
  cutoff_20_hz: number;
  cutoff_100_hz: number;
}

/** How the last lease ended. */
export interface LeaseEnd {
  owner: string;
  by: string | null;
  reason: string;
  utc_ns: number;
}

/** How late the loop woke against its absolute deadlines, over the last seconds. */
export interface LoopTiming {
  lateness_p50_ms: number;
  lateness_p99_ms: number;
  lateness_max_ms: number;
  margin_min_ms: number;
}

/** A grey image laid over its region: friction per grey level. */
export interface Map {
  kind: "map";
  image_png: string;
  black_n?: number;
  white_n: number;
}

/** Finger mobility ``s / (m s^2 + b s + k)``, friction force to skin velocity. */
export interface MassSpringDamper {
  law: "mass_spring_damper";
  mass_kg: number;
  damping_n_s_m: number;
  stiffness_n_m: number;
}

/** A `model/1` document. */
export interface Model {
  schema: "model/1";
  response: "friction" | "mobility";
  base: FirstOrderSpeedLaw | MassSpringDamper;
  input_definition: "drive_fraction";
  hold_s: number;
  skew_s: number;
  validity: Validity;
  effects: Array<Effect>;
  covariance: Covariance | null;
  participant: string | null;
  placeholder: boolean;
  provenance: unknown;
}

/** The model was adapted, or put back. */
export interface ModelChange {
  utc_ns: number;
  etag_before: string;
  etag_after: string;
  before: LawValues;
  after: LawValues;
  reason: string;
}

/** The active friction model. */
export interface ModelState {
  etag: string;
  utc_ns: number | null;
  model: Model;
  not_rendered: Record<string, string>;
  adapted_from: string | null;
  reason: string;
}

/** Announce a streamed texture; the rig is armed by this page, or shared with it. */
export interface OpenStream {
  op: "open_stream";
  rig: string;
  peak_n: number;
  id?: number | null;
}

/** Take a rig and let it drive its screen while the page is there. */
export interface PageArmRequest {
  op: "arm";
  rig: string;
  share_with?: Array<string>;
  lease_ms?: number;
  keep_model?: boolean;
  id?: number | null;
}

/** Give it back. */
export interface PageDisarmRequest {
  op: "disarm";
  rig: string;
  id?: number | null;
}

/** Ask for a pong. */
export interface Ping {
  op: "ping";
  id: number;
}

/** Move the virtual finger of the watched rig. */
export interface Point {
  op: "point";
  x_mm: number;
  y_mm: number;
  in_contact?: boolean;
  normal_force_n?: number;
}

/** The answer to a ping. */
export interface Pong {
  op: "pong";
  id: number;
  utc_us: number;
}

/** Friction over one period, sampled evenly; it repeats without end. */
export interface Profile {
  kind: "profile";
  friction_n: Array<number>;
  period_mm?: number | null;
  period_s?: number | null;
  angle_deg?: number;
}

/** What a rig's recorder does. */
export interface RecordingState {
  utc_ns: number;
  recording: boolean;
  name: string | null;
  path: string | null;
  bytes_written: number;
  seconds: number;
  blocks: number;
  lost_blocks: number;
  problem: string | null;
  refused_calls: number;
}

/** Something was not done. */
export interface Refused {
  op: "refused";
  what: string;
  code: string;
  message: string;
  id: number | null;
}

/** A rectangle of the screen that feels like `texture`; overlapping regions add. */
export interface Region {
  texture: Spectrum | Profile | Beta | Slope | Map;
  x_mm?: [number, number];
  y_mm?: [number, number];
  gain?: number;
  edge_fade_mm?: number;
  name?: string;
}

/** Friction per drive as it was measured in the last 10 s of sliding, in one band. */
export interface ResponsePoint {
  speed_mm_s: number;
  centre_hz: number;
  gain_n: number;
  half_width_db: number;
  phase_deg: number;
}

/** The watched rig is not present. It is watched still. */
export interface RigLost {
  op: "lost";
  rig: string;
}

/** What a rig is and how it fares; published at least every second. */
export interface RigStatus {
  site: string;
  rig: string;
  version: string;
  run: number;
  utc_ns: number;
  state: "disarmed" | "armed" | "stopping" | "tripped";
  fault: Fault | null;
  owner: string | null;
  share_with: Array<string>;
  last_end: LeaseEnd | null;
  last_calls: Record<string, LastCall>;
  backend: string;
  simulated: boolean;
  finger_source: "touch" | "pointer" | "simulated";
  finger_takeover: boolean;
  finger_sensors: Array<"touch" | "acceleration" | "force">;
  sample_rate_hz: number;
  block_samples: number;
  lead_ms: number;
  max_lead_ms: number | null;
  screen_mm: [number, number];
  screen_peak_v: number;
  force_limit_n: number | null;
  converter_steps: Record<string, number>;
  touch_latency_s: number | null;
  aux: Array<AuxChannel>;
  model_etag: string;
  model_placeholder: boolean;
  scene_etag: string;
  compensation: Compensation;
  adaptation: "observe" | "suggest" | "adapt";
  adaptations: number;
  stream_open: boolean;
  stream_stale: boolean;
  counters: Counters;
  timing: LoopTiming;
}

/** The rigs that are present; without a link to the router, none can be seen. */
export interface Rigs {
  op: "rigs";
  rigs: Array<string>;
  link: boolean;
}

/** What a whole screen feels like. No region at all is a smooth screen. */
export interface Scene {
  regions?: Array<Region>;
  name?: string;
}

/** The scene is in force. */
export interface SceneSet {
  op: "scene_set";
  rig: string;
  etag: string;
  applied: Applied;
  id: number | null;
}

/** The active scene. */
export interface SceneState {
  etag: string;
  scene: Scene;
  applied: Applied;
  source: "scene" | "stream" | "excitation";
  excitation: Excitation | null;
  utc_ns: number | null;
}

/** Replace what the screen feels like, with a cross-fade. */
export interface SetScene {
  op: "set_scene";
  rig: string;
  scene: Scene;
  if_match?: string | null;
  id?: number | null;
}

/** White noise through Butterworth high- and low-pass filters that meet at `peak_hz`. */
export interface Slope {
  kind: "slope";
  peak_hz: number;
  low_order: number;
  high_order: number;
  rms_n: number;
  seed?: number;
  speed_mm_s?: number | null;
  angle_deg?: number;
}

/** A sum of sinusoids, spatial (`cycles_per_mm`) and temporal (`hz`) ones alike. */
export interface Spectrum {
  kind: "spectrum";
  components: Array<Component>;
  angle_deg?: number;
  label?: string;
}

/** The texture stream has ended. */
export interface StreamClosed {
  sent: number;
  superseded: number;
  expired: number;
  newest: number | null;
  op: "stream_closed";
  rig: string;
  ticket: number;
  reason: string;
  id: number | null;
}

/** Updates may be sent: binary frames with this ticket. */
export interface StreamOpened {
  op: "stream_opened";
  rig: string;
  ticket: number;
  applied: Applied;
  id: number | null;
}

/** Told after updates came in, at most as often as frames of `watch`. */
export interface StreamProgress {
  sent: number;
  superseded: number;
  expired: number;
  newest: number | null;
  op: "stream";
  rig: string;
  ticket: number;
}

/** One component of an excitation. */
export interface Tone {
  hz: number;
  amplitude: number;
  phase_rad: number;
}

/** Where the model was measured; at other speeds its use is flagged as extrapolated. */
export interface Validity {
  speed_mm_s: [number, number];
  normal_force_n: [number, number];
  drive_vpp: [number, number];
}

/** What to send; takes the place of what was watched. */
export interface Watch {
  op: "watch";
  rig: string | null;
  streams?: Array<"force" | "accel" | "voltage" | "truth" | "aux" | "render">;
  rate_hz?: number;
  columns?: number;
  window_s?: number;
  samples_per_column?: number | null;
  raw?: boolean;
  fingers?: boolean;
}

/** The answer to hello. */
export interface Welcome {
  op: "welcome";
  version: number;
  protocol: string;
  scopes: Array<string>;
  site: string;
  client: string;
  key: string;
  utc_us: number;
}

/** The newest `state/status` of the watched rig. */
export interface StatusTold {
  op: "status";
  rig: string;
  status: RigStatus;
}

/** The newest `state/scene` of the watched rig. */
export interface SceneTold {
  op: "scene";
  rig: string;
  scene: SceneState;
}

/** The newest `state/model` of the watched rig. */
export interface ModelTold {
  op: "model";
  rig: string;
  model: ModelState;
}

/** The newest `state/finger` of the watched rig. */
export interface FingerTold {
  op: "finger";
  rig: string;
  finger: FingerState;
}

/** The newest `state/guidance` of the watched rig. */
export interface GuidanceTold {
  op: "guidance";
  rig: string;
  guidance: GuidanceState;
}

/** The newest `state/recording` of the watched rig. */
export interface RecordingTold {
  op: "recording";
  rig: string;
  recording: RecordingState;
}

/** The newest `state/estimate` of the watched rig. */
export interface EstimateTold {
  op: "estimate";
  rig: string;
  estimate: EstimateState;
}

export type Asked = Hello | Watch | Point | PageArmRequest | PageDisarmRequest | SetScene | OpenStream | CloseStream | Ping;

export type Told = Welcome | Rigs | RigLost | Armed | Disarmed | SceneSet | StreamOpened | StreamProgress | StreamClosed | Refused | Pong | StatusTold | SceneTold | ModelTold | FingerTold | GuidanceTold | RecordingTold | EstimateTold;
