/** Small typed readers over `unknown`: a cast is no check. Fields that are not asked for are ignored, as the protocol wants. */

export class DecodeError extends Error {
  constructor(
    readonly path: string,
    expected: string,
    value: unknown,
  ) {
    super(`${path || 'message'}: expected ${expected}, got ${describe(value)}`);
    this.name = 'DecodeError';
  }
}

function describe(value: unknown): string {
  if (value === null) return 'null';
  if (value === undefined) return 'nothing';
  if (Array.isArray(value)) return `an array of ${value.length}`;
  if (typeof value === 'string') return JSON.stringify(value.slice(0, 40));
  if (typeof value === 'number' || typeof value === 'boolean') return String(value);
  return typeof value;
}

/** Reads one value or throws a DecodeError that names its path. */
export type Decoder<T> = (value: unknown, path: string) => T;

/** A field that may be absent. */
export interface OptionalField<T> {
  readonly optional: Decoder<T>;
}
type Field = Decoder<unknown> | OptionalField<unknown>;
type Fields = Record<string, Field>;
type Flatten<T> = { [K in keyof T]: T[K] };
export type Decoded<F extends Fields> = Flatten<
  { [K in keyof F as F[K] extends OptionalField<unknown> ? never : K]: F[K] extends Decoder<infer T> ? T : never } & {
    [K in keyof F as F[K] extends OptionalField<unknown> ? K : never]?: F[K] extends OptionalField<infer T> ? T : never;
  }
>;

export const string: Decoder<string> = (value, path) => {
  if (typeof value !== 'string') throw new DecodeError(path, 'a string', value);
  return value;
};

export const boolean: Decoder<boolean> = (value, path) => {
  if (typeof value !== 'boolean') throw new DecodeError(path, 'true or false', value);
  return value;
};

export const number: Decoder<number> = (value, path) => {
  if (typeof value !== 'number' || !Number.isFinite(value)) throw new DecodeError(path, 'a finite number', value);
  return value;
};

export const count: Decoder<number> = (value, path) => {
  if (typeof value !== 'number' || !Number.isSafeInteger(value) || value < 0) {
    throw new DecodeError(path, 'a whole number >= 0', value);
  }
  return value;
};

/** A value whose type only the JSON tells. */
export const scalar: Decoder<number | string | boolean | null> = (value, path) =>
  value === null || typeof value === 'boolean' || typeof value === 'string' ? value : number(value, path);

export const unknown: Decoder<unknown> = (value) => value;

export function nullable<T>(inner: Decoder<T>): Decoder<T | null> {
  return (value, path) => (value === null ? null : inner(value, path));
}

export function optional<T>(inner: Decoder<T>): OptionalField<T> {
  return { optional: inner };
}

export function oneOf<const T extends string>(...words: readonly T[]): Decoder<T> {
  return (value, path) => {
    const found = words.find((word) => word === value);
    if (found === undefined) throw new DecodeError(path, `one of ${words.join(', ')}`, value);
    return found;
  };
}

export function array<T>(inner: Decoder<T>): Decoder<T[]> {
  return (value, path) => {
    if (!Array.isArray(value)) throw new DecodeError(path, 'an array', value);
    const items: unknown[] = value;
    try {
      return items.map((item) => inner(item, path));
    } catch {
      // Palettes are long: the place of an item is only spelled out when there is something to say about it.
      return items.map((item, index) => inner(item, `${path}[${index}]`));
    }
  };
}

function item<T>(inner: Decoder<T>, values: readonly unknown[], index: number, path: string): T {
  try {
    return inner(values[index], path);
  } catch {
    return inner(values[index], `${path}[${index}]`);
  }
}

export function pair<T>(inner: Decoder<T>): Decoder<[T, T]> {
  return (value, path) => {
    if (!Array.isArray(value) || value.length !== 2) throw new DecodeError(path, 'a pair', value);
    return [item(inner, value, 0, path), item(inner, value, 1, path)];
  };
}

export function triple<T>(inner: Decoder<T>): Decoder<[T, T, T]> {
  return (value, path) => {
    if (!Array.isArray(value) || value.length !== 3) throw new DecodeError(path, 'three values', value);
    return [item(inner, value, 0, path), item(inner, value, 1, path), item(inner, value, 2, path)];
  };
}

export function record(value: unknown, path: string): Record<string, unknown> {
  if (typeof value !== 'object' || value === null || Array.isArray(value)) throw new DecodeError(path, 'an object', value);
  return value as Record<string, unknown>;
}

export function dictionary<T>(inner: Decoder<T>): Decoder<Record<string, T>> {
  return (value, path) => {
    const result: Record<string, T> = {};
    for (const [key, item] of Object.entries(record(value, path))) result[key] = inner(item, join(path, key));
    return result;
  };
}

export function object<F extends Fields>(fields: F): Decoder<Decoded<F>> {
  return (value, path) => {
    const source = record(value, path);
    const result: Record<string, unknown> = {};
    for (const [key, field] of Object.entries(fields)) {
      const item = source[key];
      if (typeof field === 'function') result[key] = field(item, join(path, key));
      else if (item !== undefined) result[key] = field.optional(item, join(path, key));
    }
    return result as Decoded<F>;
  };
}

function join(path: string, key: string): string {
  return path === '' ? key : `${path}.${key}`;
}
