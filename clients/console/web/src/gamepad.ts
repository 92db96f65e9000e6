// A gamepad, as far as it moves a hand.

const DEAD_ZONE = 0.12; // of a stick that is let go
/** Buttons of the standard layout: the lower face button, the shoulders. */
const PAD = { press: 0, turn: 4, fine: 5 } as const;

/** The first gamepad that there is; a page over plain http may not ask for them. */
export function gamepad(): Gamepad | undefined {
  try {
    return navigator.getGamepads?.().find((known) => known !== null) ?? undefined;
  } catch {
    return undefined;
  }
}

/** Along right, up and away of the view, of the largest deflection. */
export interface PadMotion { right: number; up: number; away: number; isPressed: boolean; isTurning: boolean; isFine: boolean }

/** The left stick goes to the right and up, the right one away. */
export function motionOfPad(): PadMotion | undefined {
  const pad = gamepad();
  if (pad === undefined) return undefined;
  const isDown = (button: number): boolean => pad.buttons[button]?.pressed === true;
  const axis = (index: number): number => (Math.abs(pad.axes[index] ?? 0) < DEAD_ZONE ? 0 : pad.axes[index]);
  return { right: axis(0), up: 0 - axis(1), away: 0 - axis(3), isPressed: isDown(PAD.press), isTurning: isDown(PAD.turn), isFine: isDown(PAD.fine) };
}
