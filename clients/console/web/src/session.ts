// What is known of a session, from its messages alone.
import {
  NONE, RunPhase, StepPhase, type ConsoleState, type ContactPairs, type EmergencyStop, type EventLog, type GrabState, type HandState,
  type NewestRaise, type ObjectSnapshot, type ObjectState, type PairContact, type Presence, type RecorderStatus, type RunState, type SceneHand, type SceneObject,
  type SceneSignal, type SceneStep, type SceneTitle, type StepProgress, type StepState, type Telemetry, type TickStats, type WorldFrame,
} from "./messages";
import { deviceOf, type Device } from "./eventtext";
import { localized, t, type Key } from "./strings";
import { Tracks } from "./tracks";

export const TOPICS = [
  "/console", "SceneObject", "SceneHand", "SceneStep", "SceneTitle", "SceneSignal", "ObjectSnapshot", "WorldFrame_100", "HandState_100", "ContactPairs_100", "TickStats_100", "StepState", "StepProgress",
  "RunState", "GrabState", "Presence", "EmergencyStop", "EmergencyClear", "NewestRaise", "EventLog", "ClientEvent", "Telemetry", "RecorderStatus", "__instance_state",
] as const;

/** That are kept, of the server and of all stations. */
export const EVENTS = 200;

/** Times in s of the session; `seconds` [s]: the step's own time, without pauses and emergency stops. */
interface Visit { started: number; ended?: number; seconds?: number; phase?: StepPhase }
export interface StepEntry extends SceneStep, Partial<Visit> { isNow: boolean }
/** From a tick on: whether steps have their time. */
interface Run { tick: bigint; goes: boolean }
const GOES = ["running", "forces frozen"]; // events of the run
const STEP_ENDS: Record<string, StepPhase> = { "step done": StepPhase.Done, "step skipped": StepPhase.Skipped, "step timed out": StepPhase.TimedOut };

/** Keeps the newest message of each key. */
function put<K extends string, M extends Record<K, number>>(known: Map<number, M>, key: K, message: M): void {
  known.set(message[key], message);
}

export class Session {
  link?: ConsoleState;
  objects = new Map<number, SceneObject>();
  states = new Map<number, ObjectState>();
  sceneHands = new Map<number, SceneHand>();
  sceneSteps = new Map<number, SceneStep>();
  sceneSignals = new Map<number, SceneSignal>();
  sceneTitle?: SceneTitle;
  hands = new Map<number, HandState>();
  grabs = new Map<number, GrabState>();
  people = new Map<number, Presence>();
  pairs = new Map<string, PairContact & { tick: number }>();
  tracks = new Tracks();
  step?: StepState;
  progress?: StepProgress;
  run?: RunState;
  stats?: TickStats;
  telemetry = new Map<number, Telemetry>(); // by client
  devices = new Map<string, Device>(); // by the name of the hand
  recorder?: RecorderStatus;
  newestRaise?: NewestRaise;
  events: EventLog[] = [];
  tick = 0;
  /** Increased when poses, and when anything else has changed. */
  moved = 0;
  changed = 0;
  /** Of this page's clock [ms]: the newest message with poses, or the begin of a session that has sent none yet. */
  heard = 0;
  hasPoses = false; // of this session
  /** Hands that the person at this page has. */
  ownHands: ReadonlySet<number> = new Set();
  /** Somebody who leads has removed this person, who has not come back since. */
  hasRemovedUs = false;
  private raises = new Map<string, EmergencyStop>(); // by client, the newest (StopTruth)
  private clears = new Map<string, number>(); // likewise, its number
  private saysNone = false; // the server, of the raises that were heard so far; nothing was heard of it since
  private visits = new Map<string, Visit>(); // the last one of each step, by name
  private runs: RunState[] = []; // by tick
  private earlier: Run[] = []; // by events

  /** Another session begins. */
  reset(): void {
    const { link, moved, changed, ownHands } = this;
    Object.assign(this, new Session(), { link, ownHands, moved: moved + 1, changed: changed + 1 });
  }

  /** As at the beginning: what comes is of another source. */
  forget(): void {
    this.link = undefined;
    this.reset();
  }

  receive(topic: string, message: unknown, isGone: boolean): void {
    if (isGone) {
      if (topic === "Presence") this.people.delete((message as Presence).client_id);
      if (topic === "RecorderStatus") this.recorder = undefined;
      ++this.changed;
      return;
    }
    switch (topic) {
      case "/console": {
        const link = message as ConsoleState;
        if (this.link !== undefined && link.life !== this.link.life) this.reset();
        if (link.state === "joined" && (this.link?.state !== "joined" || this.heard === 0)) this.heard = performance.now();
        this.link = link;
        break;
      }
      case "SceneObject":
        put(this.objects, "object_id", message as SceneObject);
        break;
      case "SceneHand":
        put(this.sceneHands, "hand_id", message as SceneHand);
        break;
      case "SceneStep":
        put(this.sceneSteps, "step", message as SceneStep);
        break;
      case "SceneSignal":
        put(this.sceneSignals, "signal", message as SceneSignal);
        break;
      case "SceneTitle":
        this.sceneTitle = message as SceneTitle;
        break;
      case "Telemetry":
        put(this.telemetry, "client_id", message as Telemetry);
        this.tracks.link(this.tick / 1000, message as Telemetry);
        break;
      case "RecorderStatus":
        this.recorder = message as RecorderStatus;
        break;
      case "ObjectSnapshot":
        return this.place(message as ObjectSnapshot);
      case "WorldFrame_30":
      case "WorldFrame_100":
        return this.move(message as WorldFrame);
      case "HandState_100":
        return this.feel(message as HandState);
      case "ContactPairs_100":
        return this.touch(message as ContactPairs);
      case "TickStats_100":
        this.stats = message as TickStats;
        this.tracks.count(this.stats);
        return;
      case "StepState":
        this.follow(message as StepState);
        break;
      case "StepProgress":
        this.progress = message as StepProgress;
        break;
      case "RunState":
        this.run = message as RunState;
        this.runs = [...this.runs.filter(({ tick }) => tick < this.run!.tick), this.run];
        break;
      case "GrabState":
        put(this.grabs, "object_id", message as GrabState);
        break;
      case "Presence":
        put(this.people, "client_id", message as Presence);
        break;
      case "EmergencyStop": {
        const raise = message as EmergencyStop;
        if (raise.counter > (this.raises.get(raise.client_guid)?.counter ?? -1)) this.raises.set(raise.client_guid, raise);
        this.saysNone = false;
        break;
      }
      case "EmergencyClear": {
        const clear = message as EmergencyStop;
        this.clears.set(clear.client_guid, Math.max(clear.counter, this.clears.get(clear.client_guid) ?? -1));
        break;
      }
      case "NewestRaise":
        this.newestRaise = message as NewestRaise;
        this.saysNone = this.newestRaise.standing === 0 && this.link?.state === "joined";
        if (this.isWaiting) this.settle();
        break;
      case "EventLog":
        this.log(message as EventLog);
        break;
      case "ClientEvent":
        // stations tell more than is of use here
        if ((message as EventLog).kind === "device") this.know(message as EventLog);
        if ((message as EventLog).kind === "safety") this.log({ ...(message as EventLog), severity: 1 });
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
    this.hasPoses = true;
    this.settle();
    this.tick = Math.max(this.tick, Number(frame.tick));
    for (const state of frame.states) this.states.set(state.object_id, state);
    ++this.moved;
  }

  /**
   * The server has said that no raise stands, and still sends poses: those that were heard before are cleared, also where their clears are not told any more (StopTruth). A server
   * that hangs may not have heard a raise that its last word does not know of: then it stands.
   */
  private settle(): void {
    if (!this.saysNone) return;
    this.raises.clear();
    this.saysNone = false;
    ++this.changed;
  }

  private feel(hand: HandState): void {
    this.hands.set(hand.hand_id, hand);
    this.tracks.feel(this.tick / 1000, hand);
    ++this.moved;
  }

  /** Puts what was before in front of what is plotted. */
  recall(before: Tracks): void {
    this.tracks.prepend(before);
    ++this.moved;
  }

  private touch(sample: ContactPairs): void {
    this.tracks.touch(sample);
    for (const pair of sample.pairs) this.pairs.set(`${pair.a} ${pair.b}`, { ...pair, tick: Number(sample.tick) });
    ++this.moved;
  }

  private follow(step: StepState): void {
    this.step = step;
  }

  private log(event: EventLog): void {
    if (this.events.some((known) => known.seq === event.seq && known.client_id === event.client_id)) return;
    this.list(event);
    const seconds = Number(event.tick) / 1000;
    if (event.kind === "run") this.earlier = [...this.earlier.filter(({ tick }) => tick < event.tick), { tick: event.tick, goes: GOES.includes(event.text) }];
    if (event.kind === "step") this.visit(event.text, seconds);
    const phase = STEP_ENDS[event.kind];
    const visit = this.visits.get(event.text.replace(/ \(.*$/, ""));
    const own = /\(([\d.]+) s\)$/.exec(event.text)?.[1];
    if (phase !== undefined && visit !== undefined) Object.assign(visit, { phase, ended: seconds, seconds: own === undefined ? undefined : Number(own) });
  }

  /** By tick: a page that is opened late hears the server's events and those of the stations one after the other. */
  private list(event: EventLog): void {
    let at = this.events.length;
    while (at > 0 && this.events[at - 1].tick > event.tick) --at;
    this.events.splice(at, 0, event);
    const isOfServer = ({ client_id }: EventLog): boolean => client_id === undefined;
    const ofSource = this.events.filter((known) => isOfServer(known) === isOfServer(event));
    if (ofSource.length > EVENTS) this.events.splice(this.events.indexOf(ofSource[0]), 1);
  }

  /** A step begins. Those after it are to be done, too, also where they were done before it began again. */
  private visit(name: string, started: number): void {
    const steps = [...this.sceneSteps.values()];
    const index = steps.find((step) => step.name === name)?.step ?? Infinity;
    for (const step of steps) if (step.step > index) this.visits.delete(step.name);
    this.visits.set(name, { started });
  }

  private know({ text }: EventLog): void {
    const told = deviceOf(text);
    if (told !== undefined) this.devices.set(told.hand, told.device);
    ++this.moved;
  }

  /** What moves a hand, where its station has told it. */
  deviceOf(hand: number): Device | undefined {
    return this.devices.get(this.sceneHands.get(hand)?.name ?? "");
  }

  /** All steps of the scenario in their order, each with its last visit. */
  get steps(): StepEntry[] {
    const now = this.isOver || this.step === undefined ? undefined : this.step;
    return [...this.sceneSteps.values()].sort((a, b) => a.step - b.step).map((scene): StepEntry => {
      const visit = this.visits.get(scene.name);
      const isNow = now?.name === scene.name && now.phase <= StepPhase.Active;
      const started = isNow ? Number(now.started) / 1000 : visit?.started;
      const seconds = isNow && started !== undefined ? this.ownTime(started, this.tick / 1000) : visit?.seconds;
      return { ...scene, isNow, phase: isNow ? StepPhase.Active : visit?.phase, started, ended: isNow ? undefined : visit?.ended, seconds };
    });
  }

  /** [s] of a step between two times [s], as StepClock of idl/types/step_clock.h counts it. What was before the states of the run that were heard is known by its events. */
  private ownTime(begin: number, end: number): number {
    const heard = this.runs.map(({ tick, phase, emergency_stop }): Run => ({ tick, goes: phase === RunPhase.Running && emergency_stop !== true }));
    const runs = [...this.earlier.filter(({ tick }) => heard.length === 0 || tick < heard[0].tick), ...heard];
    let time = Math.max(0, end - begin);
    runs.forEach(({ tick, goes }, i) => {
      if (goes) return;
      const until = runs[i + 1] === undefined ? end : Math.min(end, Number(runs[i + 1].tick) / 1000);
      time -= Math.max(0, until - Math.max(begin, Number(tick) / 1000));
    });
    return Math.max(0, time);
  }

  /** Of each client the newest raise of the emergency stop, unless a clear has named it or a later one. */
  get standing(): EmergencyStop[] {
    return [...this.raises.values()].filter(({ client_guid, counter }) => counter > (this.clears.get(client_guid) ?? -1));
  }

  /** One that stands, by what was heard of the raises themselves, or of the server. */
  get raise(): Pick<EmergencyStop, "who" | "reason"> | undefined {
    return this.standing[0] ?? ((this.newestRaise?.standing ?? 0) > 0 ? this.newestRaise : undefined);
  }

  get isRaised(): boolean {
    return this.raise !== undefined;
  }

  /** A raise stands, and the server has said of the run that it is stopped: others may have heard of a raise, and it not. */
  get isStopped(): boolean {
    return this.isRaised && this.run?.emergency_stop === true;
  }

  /** The server knows of a raise that stands; the run stops with its next tick. */
  get isStopKnown(): boolean {
    return this.isStopped || (this.newestRaise?.standing ?? 0) > 0;
  }

  /** It is open, and has not begun: of no object it is said where it is, only where it is to begin. */
  get isWaiting(): boolean {
    return this.run?.phase === RunPhase.Waiting;
  }

  get isOver(): boolean {
    return this.run !== undefined && this.run.phase >= RunPhase.Succeeded;
  }

  /** Of the scenario; that of the announcement where the server does not tell it in all languages. */
  get title(): string {
    return localized(this.sceneTitle?.titles ?? []) || (this.link?.title ?? "");
  }

  /** Of an object; of a hand's own one what the hand is called for the reader. */
  titleOf(id: number): string {
    const hand = this.objects.get(id)?.kind === "pointer" ? [...this.sceneHands.values()].find(({ object_id }) => object_id === id) : undefined;
    return hand === undefined ? this.scenarioTitleOf(id) : this.nameOfHand(hand.hand_id);
  }

  private scenarioTitleOf(id: number): string {
    const object = this.objects.get(id);
    return localized(object?.titles ?? []) || (object?.title ?? "");
  }

  /** A title of one of the scenario's languages in this page's, if an object has it. */
  retitled(title: string): string {
    const object = [...this.objects.values()].find((known) => known.titles?.some(({ text }) => text === title));
    return object === undefined ? title : this.titleOf(object.object_id);
  }

  /**
   * What a hand is called: that of the reader by the title of its own object, which may speak to who has it; else by the role where that has one hand only, else by this title
   * as well; the hand's name is added where another hand has the same title.
   */
  nameOfHand(id: number): string {
    const hand = this.sceneHands.get(id);
    const title = this.scenarioTitleOf(hand?.object_id ?? NONE);
    if (title === "" || hand === undefined) return hand?.name ?? `${id}`;
    if (!this.ownHands.has(id) && this.isAlone(hand)) return t(`role.${hand.role}` as Key);
    const isShared = [...this.sceneHands.values()].some((other) => other.hand_id !== id && this.scenarioTitleOf(other.object_id) === title);
    return isShared ? `${title} (${hand.name})` : title;
  }

  /** A hand as a place that somebody takes: by its role, and by its name where the role has several. */
  placeOfHand(id: number): string {
    const hand = this.sceneHands.get(id);
    if (hand === undefined) return `${id}`;
    const role = t(`role.${hand.role}` as Key);
    return this.isAlone(hand) ? role : t("hand.of", { role, hand: this.nameOfHand(id) });
  }

  /** The role has no other hand, but what tracks a person. */
  private isAlone({ hand_id, role }: SceneHand): boolean {
    return ![...this.sceneHands.values()].some((other) => other.hand_id !== hand_id && other.role === role && !this.isTracked(other.hand_id)) && !this.isTracked(hand_id);
  }

  /** Whether a hand holds this for good: its pointer, or what tracks it. */
  isOwn(object: number): boolean {
    return ["pointer", "assistant", "forearm", "head"].includes(this.objects.get(object)?.kind ?? "");
  }

  isTracked(hand: number): boolean {
    return ["forearm", "head"].includes(this.objects.get(this.sceneHands.get(hand)?.object_id ?? NONE)?.kind ?? "");
  }

  /** A virtual fixture has a force on the hand. */
  isGuided(hand: number): boolean {
    return (this.hands.get(hand)?.guidance_force ?? 0) > 0.05;
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
