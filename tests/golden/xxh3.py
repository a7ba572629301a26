"""XXH3 (seed 0) of 64 and 128 bits in plain Python, for reader.py: slow, and needs nothing."""
import struct

M64 = (1 << 64) - 1
P32 = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)
P64 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63,
       0x27D4EB2F165667C5)
MX1, MX2 = 0x165667919E3779F9, 0x9FB21C651E98DF25
SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671f"
    "cb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c"
    "3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8"
    "a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364"
    "eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e"
    "2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")


def r32(data, at):
    return struct.unpack_from("<I", data, at)[0]


def r64(data, at):
    return struct.unpack_from("<Q", data, at)[0]


def swap(value, size):
    return int.from_bytes(value.to_bytes(size, "little"), "big")


def fold(a, b):
    product = a * b
    return (product & M64) ^ (product >> 64)


def avalanche(h):
    h = (h ^ h >> 37) * MX1 & M64
    return h ^ h >> 32


def avalanche64(h):
    h = (h ^ h >> 33) * P64[1] & M64
    h = (h ^ h >> 29) * P64[2] & M64
    return h ^ h >> 32


def mix16(data, at, s):
    return fold(r64(data, at) ^ r64(SECRET, s), r64(data, at + 8) ^ r64(SECRET, s + 8))


def accumulate(data):
    """The eight lanes of XXH3 over more than 240 bytes."""
    acc = [P32[2], P64[0], P64[1], P64[2], P64[3], P32[1], P64[4], P32[0]]
    keys = [struct.unpack_from("<8Q", SECRET, 8 * n) for n in range(17)]

    def stripe(at, key):
        words = struct.unpack_from("<8Q", data, at)
        for i in range(8):
            k = words[i] ^ key[i]
            acc[i ^ 1] = (acc[i ^ 1] + words[i]) & M64
            acc[i] = (acc[i] + (k & 0xFFFFFFFF) * (k >> 32)) & M64

    stripes = (len(data) - 1) // 64
    for n in range(stripes):
        stripe(64 * n, keys[n % 16])
        if n % 16 == 15:
            for i in range(8):
                acc[i] = (acc[i] ^ acc[i] >> 47 ^ keys[16][i]) * P32[0] & M64
    stripe(len(data) - 64, struct.unpack_from("<8Q", SECRET, 121))
    return acc


def merge(acc, s, start):
    for i in range(4):
        keys = struct.unpack_from("<2Q", SECRET, s + 16 * i)
        start += fold(acc[2 * i] ^ keys[0], acc[2 * i + 1] ^ keys[1])
    return avalanche(start & M64)


def xxh3_64(d):
    n = len(d)
    if n == 0:
        return avalanche64(r64(SECRET, 56) ^ r64(SECRET, 64))
    if n <= 3:
        c = d[0] << 16 | d[n >> 1] << 24 | d[-1] | n << 8
        return avalanche64(c ^ r32(SECRET, 0) ^ r32(SECRET, 4))
    if n <= 8:
        h = (r32(d, n - 4) + (r32(d, 0) << 32)) ^ r64(SECRET, 8) ^ r64(SECRET, 16)
        h ^= (h << 49 | h >> 15) & M64 ^ (h << 24 | h >> 40) & M64
        h = h * MX2 & M64
        h = (h ^ (h >> 35) + n) * MX2 & M64
        return h ^ h >> 28
    if n <= 16:
        low = r64(d, 0) ^ r64(SECRET, 24) ^ r64(SECRET, 32)
        high = r64(d, n - 8) ^ r64(SECRET, 40) ^ r64(SECRET, 48)
        return avalanche((n + swap(low, 8) + high + fold(low, high)) & M64)
    if n > 240:
        return merge(accumulate(d), 11, n * P64[0] & M64)
    acc = n * P64[0]
    if n <= 128:
        for i in range((n - 1) // 32 + 1):
            acc += mix16(d, 16 * i, 32 * i) + mix16(d, n - 16 * (i + 1), 32 * i + 16)
        return avalanche(acc & M64)
    acc = avalanche((acc + sum(mix16(d, 16 * i, 16 * i) for i in range(8))) & M64)
    acc += sum(mix16(d, 16 * i, 16 * (i - 8) + 3) for i in range(8, n // 16))
    return avalanche((acc + mix16(d, n - 16, 119)) & M64)


def xxh3_128(d):
    n = len(d)
    if n == 0:
        high, low = (avalanche64(r64(SECRET, s) ^ r64(SECRET, s + 8)) for s in (80, 64))
    elif n <= 3:
        c = d[0] << 16 | d[n >> 1] << 24 | d[-1] | n << 8
        c2 = swap(c, 4)
        c2 = (c2 << 13 | c2 >> 19) & 0xFFFFFFFF
        low = avalanche64(c ^ r32(SECRET, 0) ^ r32(SECRET, 4))
        high = avalanche64(c2 ^ r32(SECRET, 8) ^ r32(SECRET, 12))
    elif n <= 8:
        keyed = (r32(d, 0) + (r32(d, n - 4) << 32)) ^ r64(SECRET, 16) ^ r64(SECRET, 24)
        product = keyed * (P64[0] + (n << 2) & M64)
        low, high = product & M64, product >> 64
        high = (high + (low << 1)) & M64
        low ^= high >> 3
        low = (low ^ low >> 35) * MX2 & M64
        low, high = low ^ low >> 28, avalanche(high)
    elif n <= 16:
        last = r64(d, n - 8)
        product = (r64(d, 0) ^ last ^ r64(SECRET, 32) ^ r64(SECRET, 40)) * P64[0]
        low, high = (product & M64) + (n - 1 << 54) & M64, product >> 64
        last ^= r64(SECRET, 48) ^ r64(SECRET, 56)
        high = (high + last + (last & 0xFFFFFFFF) * (P32[1] - 1)) & M64
        product = (low ^ swap(high, 8)) * P64[1]
        low, high = avalanche(product & M64), avalanche((product >> 64) + high * P64[1] & M64)
    elif n <= 240:
        low, high = n * P64[0] & M64, 0

        def mix32(one, other, s):
            nonlocal low, high
            low = (low + mix16(d, one, s) & M64) ^ (r64(d, other) + r64(d, other + 8) & M64)
            high = (high + mix16(d, other, s + 16) & M64) ^ (r64(d, one) + r64(d, one + 8) & M64)

        if n <= 128:
            for i in reversed(range((n - 1) // 32 + 1)):
                mix32(16 * i, n - 16 * (i + 1), 32 * i)
        else:
            for i in range(4):
                mix32(32 * i, 32 * i + 16, 32 * i)
            low, high = avalanche(low), avalanche(high)
            for i in range(4, n // 32):
                mix32(32 * i, 32 * i + 16, 3 + 32 * (i - 4))
            mix32(n - 16, n - 32, 103)
        low, high = low + high & M64, low * P64[0] + high * P64[3] + n * P64[1] & M64
        low, high = avalanche(low), -avalanche(high) & M64
    else:
        acc = accumulate(d)
        low, high = merge(acc, 11, n * P64[0] & M64), merge(acc, 117, ~(n * P64[1]) & M64)
    return struct.pack(">QQ", high, low)
