/** The library refuses, as the robot would: with its number, its sentence and the field it is about. */
export class FusionRefusal extends Error {
  constructor(
    readonly code: number,
    readonly field: string,
    message: string,
  ) {
    super(message);
  }
}
