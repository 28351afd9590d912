"""Speak a text with the library of espeak-ng, in a process of its own: ``python espeak_library.py < request.json``.

The request is ``{"library": path or name, "voice": .., "text": .., "rate": words a minute, "wav": path}``; stdout gets
``{"rate": samples a second, "samples": n, "events": [[sample, IPA], ..]}`` and the file the sound. An event says where
a sound begins; one without a name begins a pause. Imports nothing of facegen, so that a fault of the library ends this
process only.
"""

from __future__ import annotations

import ctypes
import json
import sys
import wave

_SYNCHRONOUS, _PHONEME_EVENTS = 2, 1 | 2            # espeak_AUDIO_OUTPUT, espeakINITIALIZE_PHONEME_EVENTS and _IPA
_PHONEME, _END = 7, 0                               # espeak_EVENT_TYPE
NO_VOICE = 4
_UTF8, _RATE = 1, 1                                 # espeakCHARS_UTF8, espeakRATE


class _Name(ctypes.Union):
    _fields_ = (("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8))


class _Event(ctypes.Structure):
    _fields_ = (("type", ctypes.c_int), ("unique_identifier", ctypes.c_uint), ("text_position", ctypes.c_int),
                ("length", ctypes.c_int), ("audio_position", ctypes.c_int), ("sample", ctypes.c_int),
                ("user_data", ctypes.c_void_p), ("id", _Name))


class _Voice(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char_p), ("languages", ctypes.c_char_p), ("identifier", ctypes.c_char_p),
                ("gender", ctypes.c_ubyte), ("age", ctypes.c_ubyte), ("variant", ctypes.c_ubyte),
                ("xx1", ctypes.c_ubyte), ("score", ctypes.c_int), ("spare", ctypes.c_void_p))


def main() -> int:
    """Answer one request; 3 if the library cannot be had, 4 if the voice cannot."""
    request = json.load(sys.stdin)
    try:
        library = ctypes.CDLL(request["library"])
    except OSError as error:
        print(error, file=sys.stderr)
        return 3
    events: list[tuple[int, str]] = []
    sound = bytearray()

    def heard(samples, count, event) -> int:
        if count > 0 and samples:
            sound.extend(ctypes.string_at(samples, 2 * count))
        k = 0
        while event[k].type != _END:
            if event[k].type == _PHONEME:
                raw = ctypes.string_at(ctypes.addressof(event[k].id), 8).split(b"\0")[0]
                events.append((event[k].sample, raw.decode("utf-8", "ignore")))
            k += 1
        return 0

    callback = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(_Event))(heard)
    rate = library.espeak_Initialize(_SYNCHRONOUS, 0, None, _PHONEME_EVENTS)
    if rate <= 0:
        print("espeak_Initialize failed", file=sys.stderr)
        return 3
    library.espeak_SetSynthCallback(callback)
    voice = request["voice"].encode()
    wanted = _Voice(languages=voice)                # en-gb is a language; its voice has another name
    if library.espeak_SetVoiceByName(voice) != 0 and library.espeak_SetVoiceByProperties(ctypes.byref(wanted)) != 0:
        print(f"no voice {request['voice']}", file=sys.stderr)
        return NO_VOICE
    library.espeak_SetParameter(_RATE, int(request["rate"]), 0)
    text = request["text"].encode() + b"\0"
    if library.espeak_Synth(text, ctypes.c_size_t(len(text)), 0, 0, 0, _UTF8, None, None) != 0:
        print("espeak_Synth failed", file=sys.stderr)
        return 3
    library.espeak_Synchronize()
    with wave.open(request["wav"], "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(bytes(sound))
    json.dump({"rate": rate, "samples": len(sound) // 2, "events": events}, sys.stdout)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
