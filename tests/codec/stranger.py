"""A decoder as a stranger writes it: from docs/codec.md alone, models and all, with nothing of facegen."""

from __future__ import annotations

import binascii
import re
import struct
import zlib
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "codec.md"


def priors():
    table = re.search(r"<!-- models -->\n(.*?)<!-- /models -->", PAGE.read_text(encoding="utf-8"), re.S)[1]
    found = {}
    for question, cells in re.findall(r"^\| `(.+?)` \| (.+?) \|$", table, re.M):
        kinds = [[float(one) for one in kind.split()] for kind in cells.split(" / ")]
        found[question] = kinds * 4 if len(kinds) == 1 else kinds
    return found


class Reader:
    def __init__(self, data):
        self.data, self.at, self.range = data, 4, 2**32 - 1
        self.code = int.from_bytes((data + bytes(4))[:4], "big")
        self.models = None

    def renew(self):
        while self.range < 2**24:
            self.range <<= 8
            self.code = self.code << 8 | (self.data[self.at] if self.at < len(self.data) else 0)
            self.at += 1

    def ask(self, question, kind=0, context=0):
        model = self.models.setdefault((question, kind, context), [round(PRIORS[question][kind][context] * 65536), 8])
        bound = (self.range >> 16) * model[0]
        rate = 2 * 65536 // (2 * model[1] + 3)
        if self.code < bound:
            answer, self.range = 0, bound
            model[0] += (65536 - model[0]) * rate >> 16
        else:
            answer, self.code, self.range = 1, self.code - bound, self.range - bound
            model[0] -= model[0] * rate >> 16
        model[0] = min(max(model[0], 64), 65472)
        model[1] = min(model[1] + 1, 30)
        self.renew()
        return answer

    def even(self, count):
        value = 0
        for _ in range(count):
            self.range >>= 1
            bit = int(self.code >= self.range)
            self.code -= bit * self.range
            value = 2 * value + bit
            self.renew()
        return value

    def number(self, question, kind, sign, context=0):
        if not self.ask(question, kind, context):
            return 0
        negative = self.ask(question + " sign", kind, sign)
        size = 1
        if self.ask(question + " more", kind, 0):
            size = 2
            if self.ask(question + " more", kind, 1):
                i = 0
                while self.ask(question + " bits", kind, min(i, 3)):
                    i += 1
                size = 3 + (1 << i | self.even(i)) - 1
        return -size if negative else size


PRIORS = priors()


def ordering(value):
    return 0 if value == 0 else 1 if value > 0 else 2


class Stream:
    """Decodes the packets of a whole stream, none missing: rows of parameters by frame, None where there is no face."""

    def __init__(self, packets, arkit):
        pieces = {}
        self.rows = []
        for packet in packets:
            kind, body = packet[0] & 15, packet[5:]
            assert packet[0] >> 4 == 1
            if kind == 0:
                self.id = body[:4]
                pieces[body[4]] = body[6:]
                if len(pieces) == body[5]:
                    self.learn(b"".join(pieces[k] for k in sorted(pieces)), arkit)
            check = binascii.crc_hqx((b"" if kind == 0 else self.id) + packet[:3] + body, 0xFFFF)
            assert int.from_bytes(packet[3:5], "big") == check
            if kind in (1, 2):
                self.motion(body, kind == 1)

    def learn(self, data, arkit):
        assert self.id == zlib.crc32(data).to_bytes(4, "big")
        data = zlib.decompress(data)
        flags, self.vocabulary, up, down, self.frames, k, way = struct.unpack(">BBHHBHB", data[:10])
        self.rate, self.bounded = up / down, bool(flags & 8)
        more = [kind for bit, kind, count in ((1, 2, 3), (2, 2, 3), (4, 3, 4)) if flags & bit for _ in range(count)]
        codes, rest = data[10:10 + k + len(more)], data[10 + k + len(more):]
        partners, rest = rest[:k], rest[k:]
        self.steps = [64 * 2 ** (-code / 16) for code in codes]
        self.names = (rest.decode().split("\n") if k else []) if way == 0 else \
            [name for i, name in enumerate(arkit) if int.from_bytes(rest, "little") >> i & 1]
        self.pairs = [(a, a + ahead) for a, ahead in enumerate(partners) if ahead]
        self.kinds = [int(a in {b for _, b in self.pairs}) for a in range(k)] + more

    def motion(self, body, key):
        reader = Reader(body)
        if key:
            self.models, self.last = {}, [0] * len(self.kinds)
        reader.models = self.models
        count = 1 + reader.even(6) if reader.ask("short") else self.frames
        seen, before = [1] * count, 1
        if reader.ask("gaps"):
            for f in range(count):
                seen[f] = before = reader.ask("found", 0, before)
        if not any(seen):
            self.rows += [None] * count
            return
        p, columns = [0, 0], []
        for i, kind in enumerate(self.kinds):
            first = 0 if key else -1
            knots = {first: reader.number("start", kind, 0, p[0]) if key else self.last[i]}
            p[0] = int(knots[first] != 0)
            if first < count - 1:
                p[1] = reader.ask("moves", kind, p[0] + 2 * p[1])
                knots[count - 1] = knots[first]
                if p[1]:
                    knots[count - 1] += reader.number("end", kind, ordering(knots[first]))
                    self.halve(reader, kind, knots, first, count - 1, knots[count - 1] == knots[first])
            self.last[i] = knots[count - 1]
            columns.append([self.line(knots, f) * self.steps[i] for f in range(count)])
        self.rows += [[column[f] for column in columns] if seen[f] else None for f in range(count)]

    def halve(self, reader, kind, knots, a, b, sure=False):
        if b - a < 2:
            return
        m, rise = (a + b) // 2, knots[b] - knots[a]
        if sure or reader.ask("knot", kind, 3 * (min(len(f"{b - a:b}"), 5) - 2) + min(abs(rise), 2)):
            knots[m] = knots[a] + (2 * rise * (m - a) + b - a) // (2 * (b - a))
            knots[m] += reader.number("off", kind, ordering(rise))
            self.halve(reader, kind, knots, a, m)
            self.halve(reader, kind, knots, m, b)

    @staticmethod
    def line(knots, f):
        a = max(one for one in knots if one <= f)
        b = min(one for one in knots if one >= f)
        return knots[a] if a == b else knots[a] + (knots[b] - knots[a]) * (f - a) / (b - a)

    def weights(self, row):
        values = list(row[:len(self.names)])
        for a, b in self.pairs:
            values[a], values[b] = row[a] + row[b] / 2, row[a] - row[b] / 2
        return [min(max(value, 0.0), 1.0) for value in values] if self.bounded else values
