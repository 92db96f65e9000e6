// The scene as a headset shows it, at its size: the viewer stands before it, from the trainee's side.
import * as THREE from "three";

const STILL = 500; // [ms] without a picture of the headset: the window's frames are those of the page again

export class HeadsetView {
  /** Of the viewer in the world: as the world but in a headset, whose y is up. */
  readonly rig = new THREE.Group();
  /** Called before each picture, in place of the window's frames: browsers on standalone headsets have none of those meanwhile. */
  onFrame?: (now: number) => void;
  private frameAt = -Infinity; // [ms] of the page's clock
  private before?: THREE.PerspectiveCamera;

  /** `box`: about all that is drawn; `onPicture` after each picture, `onEnd` when the window shows the scene again. */
  constructor(private renderer: THREE.WebGLRenderer, private scene: THREE.Scene, private camera: THREE.PerspectiveCamera, private box: () => THREE.Box3, private told: { onPicture: () => void; onEnd: () => void }) {
    this.rig.add(camera);
    scene.add(this.rig);
  }

  /** The headset has the camera. */
  get isOn(): boolean {
    return this.before !== undefined;
  }

  /** Whether the headset draws, and drives the page: one that is taken off, but still in its session, does not. */
  get isDriving(): boolean {
    return performance.now() - this.frameAt < STILL;
  }

  /** `follow` is called before each picture. Fails when the headset cannot draw. */
  async enter(session: XRSession, follow: (frame: XRFrame, space: XRReferenceSpace) => void): Promise<void> {
    const { xr } = this.renderer;
    xr.enabled = true;
    this.before = this.camera.clone();
    try {
      await xr.setSession(session);
    } catch (problem) {
      this.leave();
      throw problem;
    }
    let isPlaced = false;
    this.renderer.setAnimationLoop((_, frame?: XRFrame) => {
      const space = xr.getReferenceSpace();
      if (frame === undefined || space === null) return;
      const head = frame.getViewerPose(space);
      if (!isPlaced && head !== undefined) this.placeRig(head.transform);
      isPlaced ||= head !== undefined;
      this.frameAt = performance.now();
      this.onFrame?.(this.frameAt);
      follow(frame, space);
      this.renderer.render(this.scene, this.camera);
      this.told.onPicture();
    });
  }

  leave(): void {
    this.frameAt = -Infinity;
    const { xr } = this.renderer;
    this.renderer.setAnimationLoop(null);
    xr.enabled = false;
    this.rig.position.set(0, 0, 0);
    this.rig.quaternion.identity();
    this.rig.updateMatrixWorld(true);
    if (this.before !== undefined) this.camera.copy(this.before, false);
    this.before = undefined;
    this.told.onEnd();
  }

  /** The viewer's head, wherever it is in the room, comes before the scene and looks at it. */
  private placeRig({ position, orientation }: XRRigidTransform): void {
    const scene = this.box().getBoundingSphere(new THREE.Sphere());
    const eye = scene.center.clone().add(new THREE.Vector3(0, -Math.min(1.5, 0.5 + 0.4 * scene.radius), 0.45));
    const ahead = new THREE.Vector3(0, 0, -1).applyQuaternion(orientation as unknown as THREE.Quaternion);
    const turn = new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(0, 1, 0), Math.atan2(ahead.x, -ahead.z));
    // y of the room is z of the world, and ahead is along y of the world
    this.rig.quaternion.setFromAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI / 2).multiply(turn);
    this.rig.position.copy(eye).sub(new THREE.Vector3(position.x, position.y, position.z).applyQuaternion(this.rig.quaternion));
    this.rig.updateMatrixWorld(true);
  }

  /** Where something of the headset is in the world; none while it is lost. */
  poseIn(frame: XRFrame, of: XRSpace): { p: THREE.Vector3; q: THREE.Quaternion } | undefined {
    const space = this.renderer.xr.getReferenceSpace();
    const pose = space === null ? undefined : frame.getPose(of, space);
    if (pose === undefined) return undefined;
    const { position, orientation } = pose.transform;
    return {
      p: new THREE.Vector3(position.x, position.y, position.z).applyQuaternion(this.rig.quaternion).add(this.rig.position),
      q: this.rig.quaternion.clone().multiply(new THREE.Quaternion(orientation.x, orientation.y, orientation.z, orientation.w)),
    };
  }
}
