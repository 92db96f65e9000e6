// How much of the time goes into pictures, so that what the person does is never kept waiting by them.

/** What a picture has; each is drawn in less time than the one before. */
export interface Quality { ratio: number; hasShadows: boolean }
const FULL: Quality[] = [{ ratio: 2, hasShadows: true }, { ratio: 1, hasShadows: true }, { ratio: 1, hasShadows: false }];
const SIMPLE: Quality[] = [0.75, 0.5, 0.35].map((ratio) => ({ ratio, hasShadows: false }));
const SIMPLE_PERIOD = 66; // [ms] at least between the begins of two pictures without graphics hardware
const SLOW = 100; // [ms] for a picture that is too long
const FAST = 20; // [ms] that leave room for a better one
const IN_A_ROW = 4; // slow pictures until they become simpler
const WHILE = 120; // fast ones until they become better

const LONGEST_AWAITED = 1500; // [ms] for models, until boxes are drawn in their place

/** Of a picture that could be drawn now; `showsObjects`: the last one, `awaited` [ms]: since when there are objects. */
export interface Prospect { objects: number; showsObjects: boolean; isSimple: boolean; isComplete: boolean; awaited: number }

/**
 * Do not draw an empty scene first; with software rendering, wait for models up to 1.5 s.
 */
export function isTooEarly({ objects, showsObjects, isSimple, isComplete, awaited }: Prospect): boolean {
  return objects === 0 ? !showsObjects : isSimple && !isComplete && awaited < LONGEST_AWAITED;
}

export interface Drawing { isSoftware: boolean; context?: WebGL2RenderingContext }

/**
 * Finds out whether pictures are computed by the processor. What is drawn without smooth edges is drawn in the context that found it out: another one would take a
 * part of the time until the first picture. `isSimple`: likewise whatever draws.
 */
export function openDrawing(drawing: string | null): Drawing {
  const context = document.createElement("canvas").getContext("webgl2", { antialias: false, powerPreference: "high-performance" });
  if (context === null) throw new Error("no WebGL 2");
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const name = String(context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  const isSoftware = /swiftshader|llvmpipe|software/i.test(name);
  if (drawing === "simple" || (drawing !== "full" && isSoftware)) return { isSoftware, context };
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return { isSoftware };
}

/** Begins a picture when the one before is done and as much time as that took has passed; chooses the quality by the times. */
export class Pace {
  /** Of the last picture [ms]. */
  cost = 0;
  private steps: Quality[];
  private step = 0;
  private fence: WebGLSync | null = null;
  private begun = -Infinity;
  private isFirst = true; // of its time most goes into what is made once
  private next = 0; // [ms] of the page's clock
  private slow = 0;
  private fast = 0;

  /** With `isFixed` the best quality whatever it takes. */
  constructor(private gl: WebGL2RenderingContext, private isSimple: boolean, isFixed: boolean, private onQuality: (quality: Quality) => void) {
    this.steps = isFixed ? FULL.slice(0, 1) : isSimple ? SIMPLE : [...FULL, ...SIMPLE];
  }

  get quality(): Quality {
    return this.steps[this.step];
  }

  /** Whether a picture may begin; to be asked in each frame of the display. */
  isReady(now: number): boolean {
    if (this.fence !== null) {
      if (this.gl.getSyncParameter(this.fence, this.gl.SYNC_STATUS) !== this.gl.SIGNALED && !this.gl.isContextLost()) return false;
      this.gl.deleteSync(this.fence);
      this.fence = null;
      if (!this.isFirst) this.judge(now - this.begun);
      // hardware draws beside the page, the processor instead of it
      this.next = this.isSimple && !this.isFirst ? Math.max(this.begun + SIMPLE_PERIOD, now + this.cost) : now;
      this.isFirst = false;
    }
    return now >= this.next;
  }

  /** Nothing is being drawn. */
  get isDone(): boolean {
    return this.fence === null;
  }

  /** A picture was just handed over to be drawn, which began at `now`. */
  hasDrawn(now: number): void {
    this.begun = now;
    this.fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
  }

  private judge(cost: number): void {
    this.cost = cost;
    this.slow = cost > SLOW ? this.slow + 1 : 0;
    this.fast = cost < FAST ? this.fast + 1 : 0;
    if (this.slow >= IN_A_ROW && this.step + 1 < this.steps.length) this.go(this.step + 1);
    else if (this.fast >= WHILE && this.step > 0) this.go(this.step - 1);
  }

  private go(step: number): void {
    this.step = step;
    this.slow = this.fast = 0;
    this.onQuality(this.quality);
  }
}
