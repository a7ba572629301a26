#!/usr/bin/env python3
"""Reads varve logs, written from io/FORMAT.md, io/log.capnp and io/CODEC.md alone, to keep these
pages honest: lists every record, checks every checksum, the chain and the index, decodes keyframes.

    reader.py LOG...                  one line per record
    reader.py --check logs.digests    the golden logs against their committed digests
"""
import ctypes
import ctypes.util
import os
import struct
import sys

from xxh3 import r64, xxh3_64, xxh3_128


class Bad(Exception):
    """Something that io/FORMAT.md says must be refused."""


def check(holds, what):
    if not holds:
        raise Bad(what)


class Struct:
    """A struct in a flat Cap'n Proto message of one segment. Fields are asked for by place."""

    def __init__(self, data, at, words, pointers):
        self.data, self.at, self.words, self.pointers = data, at, words, pointers

    @staticmethod
    def root(data):
        check(len(data) % 8 == 0 and len(data) > 0, "a message is a whole number of words")
        return Struct(data, 0, 0, 1).struct(0)

    def number(self, byte, kind):
        size = struct.calcsize(kind)
        if byte + size > 8 * self.words:  # a field added later: its default
            return 0
        return struct.unpack_from("<" + kind, self.data, self.at + byte)[0]

    def bit(self, n):
        return self.number(n // 8, "B") >> n % 8 & 1

    def target(self, n):
        """Word of pointer n, and the byte that its offset leads to."""
        if n >= self.pointers:
            return 0, 0
        at = self.at + 8 * (self.words + n)
        check(at + 8 <= len(self.data), "a pointer outside the message")
        word = r64(self.data, at)
        offset = word >> 2 & 0x3FFFFFFF
        return word, at + 8 + 8 * (offset - (offset >> 29 << 30))

    def struct(self, n):
        word, at = self.target(n)
        if word == 0:
            return None
        check(word & 3 == 0, "a struct is expected")
        words, pointers = word >> 32 & 0xFFFF, word >> 48
        check(0 <= at <= len(self.data) - 8 * (words + pointers), "a struct outside")
        return Struct(self.data, at, words, pointers)

    def data_bytes(self, n):
        word, at = self.target(n)
        if word == 0:
            return b""
        check(word & 3 == 1 and word >> 32 & 7 == 2, "a list of bytes is expected")
        check(0 <= at and at + (word >> 35) <= len(self.data), "bytes outside")
        return bytes(self.data[at:at + (word >> 35)])

    def text(self, n):
        return self.data_bytes(n)[:-1]  # ends in a zero byte

    def numbers(self, n, kind):
        word, at = self.target(n)
        size = struct.calcsize(kind)
        check(word == 0 or word >> 32 & 7 == {4: 4, 8: 5}[size], "a list of other numbers")
        check(0 <= at and at + (word >> 35) * size <= len(self.data), "a list outside")
        return struct.unpack_from("<%d%s" % (word >> 35, kind), self.data, at)

    def structs(self, n):
        word, at = self.target(n)
        if word == 0:
            return []
        check(word & 3 == 1 and word >> 32 & 7 == 7, "a list of structs is expected")
        tag = r64(self.data, at)
        count, words, pointers = tag >> 2 & 0x3FFFFFFF, tag >> 32 & 0xFFFF, tag >> 48
        check(at <= len(self.data) - 8 - 8 * count * (words + pointers), "a list outside")
        return [Struct(self.data, at + 8 + 8 * i * (words + pointers), words, pointers)
                for i in range(count)]

    def digest(self, byte):
        return struct.pack(">QQ", self.number(byte, "Q"), self.number(byte + 8, "Q"))

    def pairs(self, n):
        return text_list([(p.text(0), p.text(1)) for p in self.structs(n)])


def text(value):
    return struct.pack("<I", len(value)) + value


def text_list(rows):
    return struct.pack("<I", len(rows)) + b"".join(text(t) for row in rows for t in row)


def unzstd(stored, size):
    lib = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")
    lib.ZSTD_getFrameContentSize.restype = ctypes.c_ulonglong
    lib.ZSTD_decompress.restype = lib.ZSTD_findFrameCompressedSize.restype = ctypes.c_size_t
    source = (ctypes.c_char * len(stored)).from_buffer_copy(stored)
    length = ctypes.c_size_t(len(stored))
    check(lib.ZSTD_getFrameContentSize(source, length) == size, "a zstd frame of another size")
    check(lib.ZSTD_findFrameCompressedSize(source, length) == len(stored), "bytes behind zstd")
    out = ctypes.create_string_buffer(max(size, 1))
    check(lib.ZSTD_decompress(out, ctypes.c_size_t(size), source, length) == size, "zstd fails")
    return out.raw[:size]


WIDTH = {1: 8, 2: 4, 3: 8, 4: 4, 5: 1}


class Varints:
    def __init__(self, data):
        self.data, self.at = data, 0

    def next(self):
        value = shift = 0
        while True:
            check(self.at < len(self.data) and shift < 64, "a varint that does not end")
            byte = self.data[self.at]
            self.at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value


def whole_field(field, method, count, payload):
    """The values of a field of a keyframe (io/CODEC.md, methods 1 to 4), little endian."""
    width, components = WIDTH[field["type"]], field["components"]
    size = count * components * width
    if method == 1:
        check(len(payload) == size, "a plain field of another length")
        return payload
    if method == 2:
        planes, out = unzstd(payload, size), bytearray(size)
        for plane in range(components * width):
            c, byte = divmod(plane, width)
            out[c * width + byte::components * width] = planes[plane * count:(plane + 1) * count]
        return bytes(out)
    source, values, last = Varints(payload), [], [0] * components
    if method == 3:
        while len(values) < count:
            first = (values[-1] + 1 if values else 0) + source.next()
            values.extend(range(first, first + source.next() + 1))
    elif method == 4:
        for _ in range(count):
            equal = True
            for c in range(components):
                value = source.next() + (last[c] if equal else 0)
                equal, last[c] = equal and value == last[c], value
            values.extend(last)
    else:
        raise Bad("method %d in a keyframe" % method)
    check(len(values) == count * components and source.at == len(payload), "ids of another length")
    return b"".join(v.to_bytes(width, "little") for v in values)


KINDS = {1: "genesis", 2: "step", 3: "keyframe", 4: "event", 5: "end", 6: "gap", 0x81: "index"}
MAGIC = bytes.fromhex("89564152 56450d0a 1a0ad35c 91e62bf8")


class Log:
    """Walks a log from its first to its last byte; raises Bad where anything does not hold."""

    def __init__(self, data):
        self.data, self.lines, self.steps, self.decoded = data, [], {}, 0
        self.log_id = self.chain = self.last = None
        self.pending, self.events, self.index_at, self.ordinal = [], [], 0, 0
        at = sequence = 0
        while at < len(data):
            at = self.record(at, sequence)
            sequence += 1

    def record(self, at, sequence):
        head = self.data[at:at + 112]
        check(len(head) == 112 and head[:16] == MAGIC, "no record at %d" % at)
        version, kind, packing, flags = struct.unpack_from("<HBBI", head, 16)
        check(version == 1, "format version %d" % version)
        check(r64(head, 104) == xxh3_64(head[:104]), "header checksum at %d" % at)
        seq, step, durable, index = struct.unpack_from("<4Q", head, 40)
        stored, raw, body_bytes, message_sum, body_sum = struct.unpack_from("<IIQQQ", head, 72)
        self.log_id = self.log_id or head[24:40]
        check(head[24:40] == self.log_id, "record of another log at %d" % at)
        check(kind in KINDS or kind >= 0x80, "unknown critical kind %#x" % kind)
        check(flags & 0xFFFF == 1, "flags %#x" % flags)
        check(seq == sequence, "sequence %d where %d is due" % (seq, sequence))
        check(durable < max(seq, 1) and index == self.index_at, "marks of the header at %d" % at)
        body_at = at + 112 + (stored + 7) // 8 * 8
        end = body_at + (body_bytes + 7) // 8 * 8
        check(end <= len(self.data), "record at %d cut short" % at)
        message = self.data[at + 112:at + 112 + stored]
        body = self.data[body_at:body_at + body_bytes]
        check(xxh3_64(message) == message_sum, "message checksum at %d" % at)
        check(not any(self.data[at + 112 + stored:body_at]), "padding at %d" % at)
        check((xxh3_64(body) if body else 0) == body_sum, "body checksum at %d" % at)
        self.lines.append("%8d %-8s seq %-4d step %-4d %6d bytes" %
                          (at, KINDS.get(kind, hex(kind)), seq, step, end - at))
        if kind in KINDS:
            check((kind == 1) == (at == 0), "genesis comes first and once")
            root = Struct.root(unzstd(message, raw) if packing else message)
            getattr(self, "take_" + {3: "step"}.get(kind, KINDS[kind]))(root, step, at, kind, body)
        return end

    def take_genesis(self, g, *_):
        self.fields = [{"name": f.text(0), "population": f.text(1), "type": f.number(0, "B"),
                        "components": f.number(4, "I"), "unit": f.text(2), "id": f.bit(8),
                        "constant": f.bit(9), "follows": f.text(3)} for f in g.structs(1)]
        count = struct.pack("<I", len(self.fields))
        one = [text(f["name"]) + text(f["population"]) +
               struct.pack("<BI", f["type"], f["components"]) + text(f["unit"]) + bytes([f["id"]])
               for f in self.fields]
        self.chain = xxh3_128(count + b"".join(one))
        content = text(g.text(0)) + struct.pack("<I", g.number(0, "I")) + count
        for f, head in zip(self.fields, one):
            content += head + bytes([f["constant"]]) + text(f["follows"])
        tables = g.structs(2)
        content += struct.pack("<I", len(tables))
        for t in tables:
            columns = t.structs(1)
            content += text(t.text(0)) + struct.pack("<I", len(columns))
            for c in columns:
                content += text(c.text(0)) + bytes([c.number(0, "B")]) + text(c.text(1))
        content += text(g.data_bytes(3)) + g.pairs(4) + g.pairs(5)
        content += text_list([(f.text(0), f.data_bytes(1)) for f in g.structs(6)])
        content += struct.pack("<BII", g.number(4, "B"), g.number(8, "I"), g.number(12, "I"))
        lineage = g.struct(7)
        content += bytes([lineage is not None])
        if lineage:
            changes = [(c.text(0), c.text(1), c.text(2)) for c in lineage.structs(5)]
            content += text(lineage.text(0)) + struct.pack("<Q", lineage.number(0, "Q"))
            content += text_list(changes)
            self.chain = lineage.struct(4).digest(0)
        check(xxh3_128(content).hex().encode() == g.text(10), "run id")
        check(g.text(8).decode() == self.log_id.hex(), "log id")

    def take_step(self, s, step, at, kind, body):
        check(self.last is None or step == self.last + 1, "step %d after %s" % (step, self.last))
        digest, chain, stored = s.digest(16), s.digest(32), s.struct(0)
        known = self.chain is not None
        check(not known or xxh3_128(self.chain + digest) == chain, "chain at step %d" % step)
        self.chain, self.last, self.steps[step] = chain, step, digest.hex()
        self.blobs, blobs = [], (stored.structs(0), stored.structs(1)) if stored else ([], [])
        offset = 0
        for blob in blobs[0] + blobs[1]:
            size = blob.number(12, "I")
            self.blobs.append(body[offset:offset + size])
            check(xxh3_64(self.blobs[-1]) == blob.number(0, "Q"), "blob of step %d" % step)
            offset += (size + 7) // 8 * 8
        check(offset == len(body), "the blobs of step %d are not its body" % step)
        self.pending.append((step, at, 2 if kind == 3 else 1 if blobs[0] else 0))
        if kind == 3:
            state = b""
            for field, blob, payload in zip(self.fields, blobs[0], self.blobs):
                count = blob.number(8, "I")
                state += text(field["name"]) + struct.pack("<Q", count)
                state += whole_field(field, blob.number(16, "B"), count, payload)
            check(xxh3_128(state) == digest, "state of keyframe %d" % step)
            self.decoded += 1
        self.summary = (step, s.number(0, "d"), s.number(8, "d"), digest, chain)

    def take_event(self, e, step, at, *_):
        self.events.append(at)
        items = [(p.text(0), p.text(1)) for p in e.structs(1)]
        self.lines[-1] += " %s %s" % (e.text(0).decode(), items)

    def take_index(self, x, step, at, *_):
        first, offset = x.number(8, "Q"), x.number(16, "Q")
        offsets = [offset] + [offset := offset + 8 * gap for gap in x.numbers(0, "I")]
        listed = [(first + i, o, s) for i, (o, s) in enumerate(zip(offsets, x.data_bytes(1)))]
        check(listed == self.pending and list(x.numbers(3, "Q")) == self.events, "index at %d" % at)
        check(x.number(0, "Q") == self.ordinal, "number of the index at %d" % at)
        check(len(x.structs(2)) == min(self.ordinal, 15) + self.ordinal // 16, "skips at %d" % at)
        self.index_at, self.ordinal, self.pending, self.events = at, self.ordinal + 1, [], []

    def take_gap(self, g, *_):
        check(self.last is None or g.number(0, "Q") == self.last + 1, "gap")
        self.last, self.chain = g.number(8, "Q"), None

    def take_end(self, e, *_):
        said = (e.number(16, "Q"), e.number(24, "d"), e.number(32, "d"), e.struct(0).digest(0),
                e.struct(1).digest(0))
        check(said == self.summary and e.number(8, "Q") == len(self.steps), "end record")


def read(path):
    with open(path, "rb") as file:
        return file.read()


def check_golden(path):
    logs = {}
    for line in read(path).decode().splitlines():
        words = line.split()
        if words and words[0] == "log":
            steps = logs[words[1]] = {}
            data = read(os.path.join(os.path.dirname(path), words[1] + ".varve"))
            check(len(data) == int(words[2]), words[1] + ": another length")
            check(xxh3_128(data).hex() == words[3], words[1] + ": other bytes")
        elif words and words[0].isdigit():
            steps[int(words[0])] = words[1]
    for name, steps in logs.items():
        data = read(os.path.join(os.path.dirname(path), name + ".varve"))
        log = Log(data)
        check(log.steps == steps, name + ": other digests")
        check(log.decoded > 1, name + ": keyframes were decoded")
        for at in range(3, len(data), len(data) // 11):  # and it can find fault
            try:
                Log(data[:at] + bytes([data[at] ^ 16]) + data[at + 1:])
            except Bad:
                continue
            raise Bad("%s: byte %d was changed unseen" % (name, at))
        print("%s: %d bytes, %d records, %d steps, %d keyframes decoded" %
              (name, len(data), len(log.lines), len(steps), log.decoded))


def main(arguments):
    try:
        if arguments[:1] == ["--check"] and len(arguments) == 2:
            check_golden(arguments[1])
        elif arguments and not arguments[0].startswith("-"):
            for path in arguments:
                log = Log(read(path))
                print("\n".join([path] + log.lines + ["%d keyframes decoded" % log.decoded]))
        else:
            sys.exit(__doc__)
    except Bad as bad:
        sys.exit("reader.py: %s" % bad)


if __name__ == "__main__":
    main(sys.argv[1:])
