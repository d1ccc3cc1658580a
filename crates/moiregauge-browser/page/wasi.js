// Files in memory, as WASI preview 1 gives them to the program. Files that the user dropped are read in pieces.

const [BADF, EXIST, INVAL, IO, ISDIR, NOENT, NOSYS, NOTDIR, NOTEMPTY] = [8, 20, 28, 29, 31, 44, 52, 54, 55];
const [DEVICE, FOLDER, FILE] = [2, 3, 4];
const [CREATE, DIRECTORY, EXCLUSIVE, TRUNCATE] = [1, 2, 4, 8];
/** Bytes that are read of a dropped file at a time. */
const PIECE = 1 << 20;

/** A folder: names and what they stand for. */
class Folder {
  constructor() {
    /** @type {Map<string, Folder | Held | Dropped>} */
    this.inside = new Map();
    this.type = FOLDER;
    this.size = 0;
    this.time = Date.now();
  }
}

/** Bytes in memory. */
export class Held {
  /** @param {Uint8Array} [bytes] */
  constructor(bytes = new Uint8Array(0)) {
    this.bytes = bytes;
    this.size = bytes.length;
    this.type = FILE;
    this.time = Date.now();
  }

  /** @param {number} at @param {Uint8Array} into */
  read(at, into) {
    const part = this.bytes.subarray(at, Math.min(this.size, at + into.length));
    into.set(part);
    return part.length;
  }

  /** @param {number} at @param {Uint8Array} from */
  write(at, from) {
    const end = at + from.length;
    if (end > this.bytes.length) {
      const room = new Uint8Array(Math.max(end, this.size === 0 ? 0 : 2 * this.bytes.length));
      room.set(this.bytes.subarray(0, this.size));
      this.bytes = room;
    }
    this.bytes.set(from, at);
    this.size = Math.max(this.size, end);
    this.time = Date.now();
  }

  /** @param {number} size */
  cut(size) {
    const room = new Uint8Array(size);
    room.set(this.bytes.subarray(0, Math.min(size, this.size)));
    [this.bytes, this.size] = [room, size];
  }

  whole() {
    return this.bytes.slice(0, this.size);
  }
}

/** A file of the user, on the disk. */
export class Dropped {
  /** @param {File} blob */
  constructor(blob) {
    this.blob = blob;
    this.size = blob.size;
    this.type = FILE;
    this.time = blob.lastModified;
    this.piece = { at: 0, bytes: new Uint8Array(0) };
  }

  /** @param {number} at @param {Uint8Array} into */
  read(at, into) {
    const length = Math.max(0, Math.min(into.length, this.size - at));
    const { piece } = this;
    if (at < piece.at || at + length > piece.at + piece.bytes.length) {
      const end = Math.min(this.size, at + Math.max(length, PIECE));
      this.piece = { at, bytes: fromDisk(this.blob.slice(at, end)) };
    }
    const from = at - this.piece.at;
    into.set(this.piece.bytes.subarray(from, from + length));
    // What was read whole is not kept twice.
    if (length > PIECE) this.piece = { at: 0, bytes: new Uint8Array(0) };
    return length;
  }
}

/** @typedef {{node: Folder | Held | Dropped, at: number, append: boolean, path: string, written: boolean}} Open */

/** All files, and the calls of WASI on them. */
export class Files {
  /** @param {{line: (text: string) => void, changed: (path: string) => void}} hears lines of the standard output, and paths of
   * what was written or went, as soon as it is whole */
  constructor(hears) {
    this.hears = hears;
    this.root = new Folder();
    /** @type {Map<number, Open>} */
    this.open = new Map([[3, { node: this.root, at: 0, append: false, path: "", written: false }]]);
    this.next = 4;
    /** @type {Record<number, string>} */
    this.printed = { 1: "", 2: "" };
    /** What was said last on the standard error output. */
    this.complaint = "";
    /** @type {WebAssembly.Memory | null} */
    this.memory = null;
  }

  /** @param {string} path @returns {Folder | Held | Dropped | undefined} */
  find(path) {
    /** @type {Folder | Held | Dropped | undefined} */
    let node = this.root;
    for (const part of parts(path)) node = node instanceof Folder ? node.inside.get(part) : undefined;
    return node;
  }

  /** The folder that something lies in, and its name there. @param {string} path */
  place(path) {
    const all = parts(path);
    const name = all.pop() ?? "";
    const folder = this.find(all.join("/"));
    return { folder: folder instanceof Folder && name !== "" ? folder : null, name };
  }

  /** Puts something there, with the folders above it. @param {string} path @param {Held | Dropped} node */
  put(path, node) {
    const all = parts(path);
    const name = all.pop() ?? "";
    let folder = this.root;
    for (const part of all) {
      let below = folder.inside.get(part);
      if (!(below instanceof Folder)) folder.inside.set(part, (below = new Folder()));
      folder = below;
    }
    if (name !== "") folder.inside.set(name, node);
    return folder;
  }

  /** Takes something away that may have gone already. @param {string} path */
  take(path) {
    const { folder, name } = this.place(path);
    folder?.inside.delete(name);
  }

  /** @param {string} path */
  folder(path) {
    // What is put into it for a moment makes it.
    this.put(`${path}/new`, new Held()).inside.delete("new");
  }

  view() {
    return new DataView(/** @type {WebAssembly.Memory} */ (this.memory).buffer);
  }

  /** @param {number} at @param {number} length */
  bytes(at, length) {
    return new Uint8Array(/** @type {WebAssembly.Memory} */ (this.memory).buffer, at, length);
  }

  /** @param {number} fd @param {number} at @param {number} length */
  path(fd, at, length) {
    const text = new TextDecoder().decode(this.bytes(at, length));
    const base = this.open.get(fd)?.path ?? "";
    return parts(`${base}/${text}`).join("/");
  }

  /** @param {number} at @param {number} count */
  pieces(at, count) {
    const view = this.view();
    return Array.from({ length: count }, (_, i) => this.bytes(view.getUint32(at + 8 * i, true), view.getUint32(at + 8 * i + 4, true)));
  }

  /** @param {number} at @param {Folder | Held | Dropped} node */
  stat(at, node) {
    const view = this.view();
    this.bytes(at, 64).fill(0);
    view.setUint8(at + 16, node.type);
    view.setBigUint64(at + 24, 1n, true);
    view.setBigUint64(at + 32, BigInt(node.size), true);
    for (const time of [40, 48, 56]) view.setBigUint64(at + time, BigInt(Math.round(node.time)) * 1000000n, true);
    return 0;
  }

  /** @param {number} fd @param {Uint8Array[]} pieces */
  print(fd, pieces) {
    const lines = (this.printed[fd] + pieces.map((p) => new TextDecoder().decode(p.slice())).join("")).split("\n");
    this.printed[fd] = lines.pop() ?? "";
    for (const line of lines) {
      if (fd === 1) this.hears.line(line);
      else this.complaint = `${this.complaint}\n${line}`.slice(-2000);
    }
  }

  /**
   * @param {number} fd
   * @param {number} iovs
   * @param {number} count
   * @param {number} out
   * @param {number | null} at
   */
  read(fd, iovs, count, out, at) {
    const file = this.open.get(fd);
    if (!file) return BADF;
    if (file.node instanceof Folder) return ISDIR;
    let [place, total] = [at ?? file.at, 0];
    try {
      for (const piece of this.pieces(iovs, count)) {
        const read = file.node.read(place, piece);
        [place, total] = [place + read, total + read];
        if (read < piece.length) break;
      }
    } catch {
      // Written anew or gone since it was dropped.
      return IO;
    }
    if (at === null) file.at = place;
    this.view().setUint32(out, total, true);
    return 0;
  }

  /**
   * @param {number} fd
   * @param {number} iovs
   * @param {number} count
   * @param {number} out
   * @param {number | null} at
   */
  write(fd, iovs, count, out, at) {
    const pieces = this.pieces(iovs, count);
    const total = pieces.reduce((sum, piece) => sum + piece.length, 0);
    if (fd === 1 || fd === 2) this.print(fd, pieces);
    else {
      const file = this.open.get(fd);
      if (!file || !(file.node instanceof Held)) return BADF;
      let place = at ?? (file.append ? file.node.size : file.at);
      for (const piece of pieces) {
        file.node.write(place, piece);
        place += piece.length;
      }
      if (at === null) file.at = place;
      file.written = true;
    }
    this.view().setUint32(out, total, true);
    return 0;
  }

  /** The calls, for an instance of the program. @returns {Record<string, Function>} */
  calls() {
    const none = () => 0;
    const of = (/** @type {number} */ fd, /** @type {(file: Open) => number} */ what) => {
      const file = this.open.get(fd);
      return file ? what(file) : BADF;
    };
    /** @type {Record<string, Function>} */
    const calls = {
      args_get: none, environ_get: none, fd_advise: none, fd_sync: none, fd_datasync: none, fd_fdstat_set_flags: none,
      fd_filestat_set_times: none, path_filestat_set_times: none, sched_yield: none, poll_oneoff: none,
      args_sizes_get: (/** @type {number} */ n, /** @type {number} */ size) => this.two(n, size),
      environ_sizes_get: (/** @type {number} */ n, /** @type {number} */ size) => this.two(n, size),
      clock_time_get: (/** @type {number} */ id, /** @type {bigint} */ _, /** @type {number} */ out) => {
        const now = id === 0 ? Date.now() : performance.now();
        this.view().setBigUint64(out, BigInt(Math.round(now * 1e6)), true);
        return 0;
      },
      random_get: (/** @type {number} */ at, /** @type {number} */ length) => {
        const some = new Uint8Array(length);
        for (let i = 0; i < length; i += 65536) crypto.getRandomValues(some.subarray(i, i + 65536));
        this.bytes(at, length).set(some);
        return 0;
      },
      proc_exit: (/** @type {number} */ code) => {
        throw new Error(`the program ended with ${code}`);
      },
      fd_close: (/** @type {number} */ fd) => of(fd, (file) => {
        this.open.delete(fd);
        if (file.written) this.hears.changed(file.path);
        return 0;
      }),
      fd_prestat_get: (/** @type {number} */ fd, /** @type {number} */ out) => {
        if (fd !== 3) return BADF;
        this.view().setUint32(out, 0, true);
        this.view().setUint32(out + 4, 1, true);
        return 0;
      },
      fd_prestat_dir_name: (/** @type {number} */ _, /** @type {number} */ at) => {
        this.bytes(at, 1)[0] = 47;
        return 0;
      },
      fd_fdstat_get: (/** @type {number} */ fd, /** @type {number} */ out) => {
        this.bytes(out, 24).fill(0);
        const type = fd < 3 ? DEVICE : this.open.get(fd)?.node.type;
        if (type === undefined) return BADF;
        this.view().setUint8(out, type);
        this.bytes(out + 8, 16).fill(0xff);
        return 0;
      },
      fd_filestat_get: (/** @type {number} */ fd, /** @type {number} */ out) => of(fd, (file) => this.stat(out, file.node)),
      fd_filestat_set_size: (/** @type {number} */ fd, /** @type {bigint} */ size) => of(fd, (file) => {
        const { node } = file;
        if (!(node instanceof Held)) return INVAL;
        node.cut(Number(size));
        file.written = true;
        return 0;
      }),
      fd_seek: (/** @type {number} */ fd, /** @type {bigint} */ offset, /** @type {number} */ from, /** @type {number} */ out) => of(fd, (file) => {
        file.at = [0, file.at, file.node.size][from] + Number(offset);
        this.view().setBigUint64(out, BigInt(file.at), true);
        return 0;
      }),
      fd_tell: (/** @type {number} */ fd, /** @type {number} */ out) => of(fd, (file) => {
        this.view().setBigUint64(out, BigInt(file.at), true);
        return 0;
      }),
      fd_read: (/** @type {number} */ fd, /** @type {number} */ i, /** @type {number} */ n, /** @type {number} */ out) => this.read(fd, i, n, out, null),
      fd_pread: (/** @type {number} */ fd, /** @type {number} */ i, /** @type {number} */ n, /** @type {bigint} */ at, /** @type {number} */ out) => this.read(fd, i, n, out, Number(at)),
      fd_write: (/** @type {number} */ fd, /** @type {number} */ i, /** @type {number} */ n, /** @type {number} */ out) => this.write(fd, i, n, out, null),
      fd_pwrite: (/** @type {number} */ fd, /** @type {number} */ i, /** @type {number} */ n, /** @type {bigint} */ at, /** @type {number} */ out) => this.write(fd, i, n, out, Number(at)),
      fd_readdir: (/** @type {number} */ fd, /** @type {number} */ at, /** @type {number} */ length, /** @type {bigint} */ cookie, /** @type {number} */ out) => of(fd, ({ node }) => {
        if (!(node instanceof Folder)) return NOTDIR;
        const listed = this.listing(node, Number(cookie)).subarray(0, length);
        this.bytes(at, listed.length).set(listed);
        this.view().setUint32(out, listed.length, true);
        return 0;
      }),
      path_create_directory: (/** @type {number} */ fd, /** @type {number} */ at, /** @type {number} */ length) => {
        const { folder, name } = this.place(this.path(fd, at, length));
        if (!folder) return NOENT;
        if (folder.inside.has(name)) return EXIST;
        folder.inside.set(name, new Folder());
        return 0;
      },
      path_filestat_get: (/** @type {number} */ fd, /** @type {number} */ _, /** @type {number} */ at, /** @type {number} */ length, /** @type {number} */ out) => {
        const node = this.find(this.path(fd, at, length));
        return node ? this.stat(out, node) : NOENT;
      },
      path_open: (/** @type {number} */ fd, /** @type {number} */ _, /** @type {number} */ at, /** @type {number} */ length, /** @type {number} */ how,
        /** @type {bigint} */ _rights, /** @type {bigint} */ _inherited, /** @type {number} */ flags, /** @type {number} */ out) => this.opened(this.path(fd, at, length), how, flags, out),
      path_rename: (/** @type {number} */ fd, /** @type {number} */ at, /** @type {number} */ length, /** @type {number} */ toFd, /** @type {number} */ to, /** @type {number} */ toLength) => {
        const [from, into] = [this.path(fd, at, length), this.path(toFd, to, toLength)];
        const [here, there] = [this.place(from), this.place(into)];
        const node = here.folder?.inside.get(here.name);
        if (!node || !there.folder) return NOENT;
        here.folder?.inside.delete(here.name);
        there.folder.inside.set(there.name, node);
        for (const below of filesIn(node)) {
          this.hears.changed(from + below);
          this.hears.changed(into + below);
        }
        return 0;
      },
      path_unlink_file: (/** @type {number} */ fd, /** @type {number} */ at, /** @type {number} */ length) => this.removed(this.path(fd, at, length), false),
      path_remove_directory: (/** @type {number} */ fd, /** @type {number} */ at, /** @type {number} */ length) => this.removed(this.path(fd, at, length), true),
    };
    return new Proxy(calls, { get: (all, name) => all[String(name)] ?? (() => NOSYS) });
  }

  /** @param {number} a @param {number} b */
  two(a, b) {
    this.view().setUint32(a, 0, true);
    this.view().setUint32(b, 0, true);
    return 0;
  }

  /** @param {string} path @param {number} how @param {number} flags @param {number} out */
  opened(path, how, flags, out) {
    let [node, written] = [this.find(path), false];
    if (node && how & EXCLUSIVE) return EXIST;
    if (!node) {
      const { folder, name } = this.place(path);
      if (!(how & CREATE) || !folder) return NOENT;
      folder.inside.set(name, (node = new Held()));
      written = true;
    }
    if (how & DIRECTORY && !(node instanceof Folder)) return NOTDIR;
    if (how & TRUNCATE && !(node instanceof Folder)) {
      node = new Held();
      this.put(path, node);
      written = true;
    }
    const fd = this.next++;
    this.open.set(fd, { node, at: 0, append: (flags & 1) === 1, path, written });
    this.view().setUint32(out, fd, true);
    return 0;
  }

  /** @param {string} path @param {boolean} folder */
  removed(path, folder) {
    const { folder: above, name } = this.place(path);
    const node = above?.inside.get(name);
    if (!above || !node) return NOENT;
    if (node instanceof Folder !== folder) return folder ? NOTDIR : ISDIR;
    if (node instanceof Folder && node.inside.size > 0) return NOTEMPTY;
    above.inside.delete(name);
    this.hears.changed(path);
    return 0;
  }

  /** Names and kinds of what a folder holds, from number `first` on. @param {Folder} folder @param {number} first */
  listing(folder, first) {
    const entries = [...folder.inside].slice(first).map(([name, node], i) => {
      const text = new TextEncoder().encode(name);
      const entry = new Uint8Array(24 + text.length);
      const view = new DataView(entry.buffer);
      view.setBigUint64(0, BigInt(first + i + 1), true);
      view.setBigUint64(8, 1n, true);
      view.setUint32(16, text.length, true);
      view.setUint8(20, node.type);
      entry.set(text, 24);
      return entry;
    });
    const all = new Uint8Array(entries.reduce((sum, e) => sum + e.length, 0));
    let at = 0;
    for (const entry of entries) {
      all.set(entry, at);
      at += entry.length;
    }
    return all;
  }
}

/** The places of all files in something, as seen from it; of a file that of itself. @param {Folder | Held | Dropped} node @returns {string[]} */
function filesIn(node) {
  if (!(node instanceof Folder)) return [""];
  return [...node.inside].flatMap(([name, inside]) => filesIn(inside).map((below) => `/${name}${below}`));
}

/** Bytes of a file of the user. @param {Blob} part */
function fromDisk(part) {
  // Workers have it; types are those of pages.
  return new Uint8Array(new /** @type {any} */ (globalThis).FileReaderSync().readAsArrayBuffer(part));
}

/** The names in a path, without those that lead nowhere. @param {string} path */
function parts(path) {
  return path.split("/").filter((part) => part !== "" && part !== ".");
}
