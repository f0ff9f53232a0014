/** Where the module is; null: this program was built without it. */
declare module 'virtual:fusion-module' {
  const address: string | null;
  export default address;
}
