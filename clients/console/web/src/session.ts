// What is known of a session, from its messages alone.
import {
  NONE, RunPhase, StepPhase, type ConsoleState, type ContactPairs, type EmergencyStop, type EventLog, type GrabState, type HandState,
  type ObjectSnapshot, type ObjectState, type PairContact, type Presence, type RunState, type SceneObject, type StepProgress, type StepState,
  type TickStats, type WorldFrame,
} from "./messages";

export const TOPICS = [
  "/console", "SceneObject", "ObjectSnapshot", "WorldFrame_100", "HandState_100", "ContactPairs_100", "TickStats_100", "StepState", "StepProgress",
  "RunState", "GrabState", "Presence", "EmergencyStop", "EmergencyClear", "EventLog", "__instance_state",
] as const;

const HISTORY = 3000; // samples of a hand: 30 s
const EVENTS = 200;

export interface StepEntry { name: string; title: StepState["title"]; part: string; phase: StepPhase; started: number; ended?: number }
export interface HandHistory { times: number[]; forces: number[]; peak: number }

export class Session {
  link?: ConsoleState;
  objects = new Map<number, SceneObject>();
  states = new Map<number, ObjectState>();
  hands = new Map<number, HandState>();
  grabs = new Map<number, GrabState>();
  people = new Map<number, Presence>();
  pairs = new Map<string, PairContact & { tick: number }>();
  history = new Map<number, HandHistory>();
  step?: StepState;
  progress?: StepProgress;
  run?: RunState;
  stats?: TickStats;
  events: EventLog[] = [];
  tick = 0;
  /** Increased when poses, and when anything else has changed. */
  moved = 0;
  changed = 0;
  /** Of this page's clock [ms]: the newest message with poses. */
  heard = 0;
  private raises = new Map<string, EmergencyStop>();
  private clears = new Set<string>();
  private names = new Map<number, string>(); // of hands
  private known = new Map<string, StepState>();
  private visits: { name: string; started: number }[] = [];

  /** Another session begins. */
  private reset(): void {
    const link = this.link;
    Object.assign(this, new Session());
    this.link = link;
  }

  receive(topic: string, message: unknown, isGone: boolean): void {
    if (isGone) {
      if (topic === "Presence") this.people.delete((message as Presence).client_id);
      ++this.changed;
      return;
    }
    switch (topic) {
      case "/console": {
        const link = message as ConsoleState;
        if (this.link !== undefined && link.life !== this.link.life) this.reset();
        this.link = link;
        break;
      }
      case "SceneObject": {
        const object = message as SceneObject;
        this.objects.set(object.object_id, object);
        break;
      }
      case "ObjectSnapshot":
        return this.place(message as ObjectSnapshot);
      case "WorldFrame_100":
        return this.move(message as WorldFrame);
      case "HandState_100":
        return this.feel(message as HandState);
      case "ContactPairs_100":
        return this.touch(message as ContactPairs);
      case "TickStats_100":
        this.stats = message as TickStats;
        return;
      case "StepState":
        this.follow(message as StepState);
        break;
      case "StepProgress":
        this.progress = message as StepProgress;
        break;
      case "RunState":
        this.run = message as RunState;
        break;
      case "GrabState": {
        const grab = message as GrabState;
        this.grabs.set(grab.object_id, grab);
        if (grab.hand_id !== NONE && this.isOwn(grab.object_id)) this.names.set(grab.hand_id, this.titleOf(grab.object_id));
        break;
      }
      case "Presence": {
        const presence = message as Presence;
        this.people.set(presence.client_id, presence);
        break;
      }
      case "EmergencyStop": {
        const raise = message as EmergencyStop;
        this.raises.set(`${raise.client_guid}/${raise.counter}`, raise);
        break;
      }
      case "EmergencyClear": {
        const clear = message as EmergencyStop;
        this.clears.add(`${clear.client_guid}/${clear.counter}`);
        break;
      }
      case "EventLog":
        this.log(message as EventLog);
        break;
    }
    ++this.changed;
  }

  private place(snapshot: ObjectSnapshot): void {
    // a snapshot may be older than what frames have told
    const known = this.states.get(snapshot.object_id);
    if (known !== undefined && known.epoch >= snapshot.state.epoch && Number(snapshot.tick) < this.tick) return;
    this.states.set(snapshot.object_id, snapshot.state);
    ++this.moved;
  }

  private move(frame: WorldFrame): void {
    this.heard = performance.now();
    this.tick = Math.max(this.tick, Number(frame.tick));
    for (const state of frame.states) this.states.set(state.object_id, state);
    ++this.moved;
  }

  private feel(hand: HandState): void {
    this.hands.set(hand.hand_id, hand);
    const force = Math.hypot(hand.F_Ho_W.force[0], hand.F_Ho_W.force[1], hand.F_Ho_W.force[2]);
    let history = this.history.get(hand.hand_id);
    if (history === undefined) this.history.set(hand.hand_id, (history = { times: [], forces: [], peak: 0 }));
    const seconds = this.tick / 1000;
    if (history.times.length > 0 && seconds <= history.times[history.times.length - 1]) {
      // of one time the largest counts
      history.forces[history.forces.length - 1] = Math.max(force, history.forces[history.forces.length - 1]);
    } else {
      history.times.push(seconds);
      history.forces.push(force);
    }
    history.peak = Math.max(history.peak, force);
    if (history.times.length > HISTORY) {
      history.times.shift();
      history.forces.shift();
    }
    ++this.moved;
  }

  private touch(sample: ContactPairs): void {
    for (const pair of sample.pairs) this.pairs.set(`${pair.a} ${pair.b}`, { ...pair, tick: Number(sample.tick) });
    ++this.moved;
  }

  private follow(step: StepState): void {
    this.step = step;
    this.known.set(step.name, step);
  }

  private log(event: EventLog): void {
    if (this.events.some((known) => known.seq === event.seq)) return;
    this.events.push(event);
    if (this.events.length > EVENTS) this.events.shift();
    if (event.kind === "step") this.visits.push({ name: event.text, started: Number(event.tick) / 1000 });
  }

  /** The steps so far, in order: of those before this page came only the names are known, from the log. */
  get steps(): StepEntry[] {
    const visits = [...this.visits];
    const now = this.step;
    if (now !== undefined && visits[visits.length - 1]?.name !== now.name) visits.push({ name: now.name, started: Number(now.started) / 1000 });
    return visits.map(({ name, started }, i) => {
      const state = this.known.get(name);
      const isLast = i === visits.length - 1;
      const phase = state === undefined || (!isLast && state.phase < StepPhase.Done) ? StepPhase.Done : state.phase;
      const end = isLast ? (phase >= StepPhase.Done || this.isOver ? Number(this.run?.tick ?? this.tick) / 1000 : undefined) : visits[i + 1].started;
      return { name, title: state?.title ?? [], part: state?.part ?? "", phase, started, ended: end };
    });
  }

  /** Raises of the emergency stop that no clear has named. */
  get standing(): EmergencyStop[] {
    return [...this.raises].filter(([key]) => !this.clears.has(key)).map(([, raise]) => raise);
  }

  get isOver(): boolean {
    return this.run !== undefined && this.run.phase >= RunPhase.Succeeded;
  }

  titleOf(id: number): string {
    return this.objects.get(id)?.title ?? "";
  }

  /** Title of a hand's own pointer, else of what it holds. */
  nameOfHand(id: number): string {
    const name = this.names.get(id);
    if (name !== undefined && name !== "") return name;
    const own = [...this.grabs.values()].find(
      (grab) => grab.hand_id === id && ["pointer", "assistant", "tool", "forearm", "head"].includes(this.objects.get(grab.object_id)?.kind ?? ""),
    );
    const held = own ?? [...this.grabs.values()].find((grab) => grab.hand_id === id);
    return held === undefined ? `${id}` : this.titleOf(held.object_id);
  }

  /** Whether a hand holds this for good: its pointer, or what tracks it. */
  isOwn(object: number): boolean {
    return ["pointer", "assistant", "forearm", "head"].includes(this.objects.get(object)?.kind ?? "");
  }

  isTracked(hand: number): boolean {
    return [...this.grabs.values()].some((grab) => grab.hand_id === hand && ["forearm", "head"].includes(this.objects.get(grab.object_id)?.kind ?? ""));
  }

  /** Pose errors of the step within its tolerances. */
  get isWithinTolerance(): boolean {
    const { step, progress } = this;
    return step !== undefined && progress !== undefined && progress.revision === step.revision && step.has_target &&
      progress.position_error <= step.tolerance && progress.angle_error <= step.angle_tolerance;
  }

  holderOf(object: number): number {
    return this.states.get(object)?.holder ?? NONE;
  }
}
