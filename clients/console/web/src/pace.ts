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

/** Whether pictures are computed by the processor. */
export function isSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (gl === null) throw new Error("no WebGL 2");
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

/** Begins a picture when the one before is done and as much time as that took has passed; chooses the quality by the times. */
export class Pace {
  /** Of the last picture [ms]. */
  cost = 0;
  private steps: Quality[];
  private step = 0;
  private fence: WebGLSync | null = null;
  private begun = -Infinity;
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
      this.judge(now - this.begun);
      // hardware draws beside the page, the processor instead of it
      this.next = this.isSimple ? Math.max(this.begun + SIMPLE_PERIOD, now + this.cost) : now;
    }
    return now >= this.next;
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
