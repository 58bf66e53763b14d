/*
 * The vehicle's end of the kerbside line protocol. See kerbside_line.h and README.md.
 *
 * SPDX-License-Identifier: Apache-2.0 OR MIT
 */
#include "kerbside_line.h"

#include <string.h>

/* The layouts hold IEEE 754 binary32: this does not compile where float has another size. */
typedef char kb_float_has_32_bits[sizeof(float) == 4 ? 1 : -1];

enum { CHECK_SUM = 4, MAX_FIELDS = KB_MAX_ENCODED - 1 - CHECK_SUM };

enum { HAS_STEERING = 1, HAS_YAW_RATE = 2, WIDE = 4, ACKNOWLEDGES = 8, SILENT = 16 };

enum { REASON_VERSION = 1, REASON_BOOT = 2 };

enum { START_LENGTH = 10, COMMAND_LENGTH = 13 };

/* ---- numbers, little-endian on any machine ---- */

static uint8_t *put_u8(uint8_t *to, unsigned value)
{
    *to = (uint8_t)value;
    return to + 1;
}

static uint8_t *put_u32(uint8_t *to, uint32_t value)
{
    int i;
    for (i = 0; i < 4; i++) {
        to[i] = (uint8_t)(value >> (8 * i));
    }
    return to + 4;
}

static uint8_t *put_u64(uint8_t *to, uint64_t value)
{
    return put_u32(put_u32(to, (uint32_t)value), (uint32_t)(value >> 32));
}

static uint8_t *put_f32(uint8_t *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_u32(to, bits);
}

static uint32_t get_u32(const uint8_t *from)
{
    return (uint32_t)from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16
        | (uint32_t)from[3] << 24;
}

static float get_f32(const uint8_t *from)
{
    const uint32_t bits = get_u32(from);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* By the bits, since fast-math compilers may drop a comparison with itself. */
static int is_finite(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

/* ---- frames ---- */

uint32_t kb_crc32(const uint8_t *bytes, size_t length)
{
    /* Half a byte at a time: 64 bytes of table, a quarter of the bitwise steps. */
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u,
        0x4db26158u, 0x5005713cu, 0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu,
        0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
    };
    uint32_t sum = 0xffffffffu;
    size_t i;
    for (i = 0; i < length; i++) {
        sum ^= bytes[i];
        sum = sum >> 4 ^ table[sum & 15u];
        sum = sum >> 4 ^ table[sum & 15u];
    }
    return ~sum;
}

size_t kb_seal(const uint8_t *message, size_t length, uint8_t out[KB_MAX_FRAME])
{
    uint8_t sum[CHECK_SUM];
    size_t code = 1; /* where the running block's length goes */
    size_t end = 2;
    size_t i;
    put_u32(sum, kb_crc32(message, length));
    out[0] = 0;
    for (i = 0; i < length + CHECK_SUM; i++) {
        const uint8_t byte = i < length ? message[i] : sum[i - length];
        if (byte == 0) {
            out[code] = (uint8_t)(end - code);
            code = end;
        } else {
            out[end] = byte;
        }
        end++;
    }
    out[code] = (uint8_t)(end - code);
    out[end] = 0;
    return end + 1;
}

/* COBS of at most 254 bytes; returns the length, 0 if it is no such encoding. */
static size_t decode_cobs(uint8_t *bytes, size_t length)
{
    size_t from = 0;
    size_t to = 0;
    while (from < length) {
        const size_t block = bytes[from];
        if (block == 0 || from + block > length) {
            return 0;
        }
        memmove(bytes + to, bytes + from + 1, block - 1);
        to += block - 1;
        from += block;
        if (from < length) {
            bytes[to++] = 0;
        }
    }
    return to;
}

size_t kb_open(uint8_t *encoded, size_t length)
{
    const size_t content = decode_cobs(encoded, length);
    size_t message;
    if (content <= CHECK_SUM) {
        return 0;
    }
    message = content - CHECK_SUM;
    return kb_crc32(encoded, message) == get_u32(encoded + message) ? message : 0;
}

/* ---- what is heard ---- */

static kb_event refuse(kb_vehicle *vehicle, uint8_t reason, uint8_t version, uint32_t boot)
{
    vehicle->started = 0;
    vehicle->refusal = reason;
    vehicle->asked_version = version;
    vehicle->asked_boot = boot;
    return KB_REFUSED;
}

static kb_event count_error(kb_vehicle *vehicle)
{
    vehicle->line_errors++;
    return KB_NOTHING;
}

static kb_event on_start(kb_vehicle *vehicle, const uint8_t *message, size_t length)
{
    /* Another version's START may be of another length. */
    if (length >= 2 && message[1] != KB_PROTOCOL_VERSION) {
        return refuse(vehicle, REASON_VERSION, message[1], 0);
    }
    if (length != START_LENGTH) {
        return count_error(vehicle);
    }
    if (get_u32(message + 2) != vehicle->hello.boot) {
        return refuse(vehicle, REASON_BOOT, message[1], get_u32(message + 2));
    }
    vehicle->started = 1;
    vehicle->commanded = 0;
    vehicle->refusal = 0;
    vehicle->accepted = get_u32(message + 6);
    return KB_STARTED;
}

static kb_event on_command(kb_vehicle *vehicle, uint64_t now_ns, const uint8_t *message,
                           size_t length, kb_command *command)
{
    kb_command heard;
    uint32_t ahead;
    if (length != COMMAND_LENGTH) {
        return count_error(vehicle);
    }
    heard.sequence = get_u32(message + 1);
    heard.speed = get_f32(message + 5);
    heard.steering = get_f32(message + 9);
    if (!is_finite(heard.speed) || !is_finite(heard.steering)) {
        return count_error(vehicle);
    }
    /* Sequences wrap: newer is what lies less than half the numbers ahead. */
    ahead = heard.sequence - vehicle->accepted;
    if (!vehicle->started || ahead == 0 || ahead > 0x7fffffffu) {
        vehicle->ignored++;
        return KB_NOTHING;
    }
    vehicle->accepted = heard.sequence;
    vehicle->commanded = 1;
    vehicle->commanded_ns = now_ns;
    *command = heard;
    return KB_COMMANDED;
}

static kb_event on_frame(kb_vehicle *vehicle, uint64_t now_ns, kb_command *command)
{
    const size_t length = kb_open(vehicle->buffer, vehicle->length);
    if (length == 0) {
        return count_error(vehicle);
    }
    switch (vehicle->buffer[0]) {
    case 'S':
        return on_start(vehicle, vehicle->buffer, length);
    case 'C':
        return on_command(vehicle, now_ns, vehicle->buffer, length, command);
    default:
        return count_error(vehicle);
    }
}

kb_event kb_vehicle_receive(kb_vehicle *vehicle, uint64_t now_ns, uint8_t byte,
                            kb_command *command)
{
    kb_event event = KB_NOTHING;
    if (byte != 0) {
        if (vehicle->length < KB_MAX_ENCODED) {
            vehicle->buffer[vehicle->length++] = byte;
        } else {
            vehicle->overlong = 1;
        }
        return KB_NOTHING;
    }
    if (vehicle->overlong) {
        event = count_error(vehicle);
    } else if (vehicle->length > 0) {
        event = on_frame(vehicle, now_ns, command);
    }
    vehicle->length = 0;
    vehicle->overlong = 0;
    return event;
}

/* ---- what is said ---- */

void kb_vehicle_init(kb_vehicle *vehicle, const kb_hello *hello)
{
    memset(vehicle, 0, sizeof *vehicle);
    vehicle->hello = *hello;
}

int kb_vehicle_silent(const kb_vehicle *vehicle, uint64_t now_ns)
{
    const uint64_t limit = (uint64_t)vehicle->hello.silence_ms * 1000000u;
    if (!vehicle->started || !vehicle->commanded) {
        return 1;
    }
    return now_ns > vehicle->commanded_ns && now_ns - vehicle->commanded_ns >= limit;
}

static size_t say_refusal(kb_vehicle *vehicle, uint8_t out[KB_MAX_FRAME])
{
    uint8_t message[MAX_FIELDS];
    uint8_t *end = put_u8(message, 'X');
    end = put_u8(end, KB_PROTOCOL_VERSION);
    end = put_u32(end, vehicle->hello.boot);
    end = put_u8(end, vehicle->refusal);
    end = put_u8(end, vehicle->asked_version);
    end = put_u32(end, vehicle->asked_boot);
    vehicle->refusal = 0;
    return kb_seal(message, (size_t)(end - message), out);
}

static unsigned wheels(unsigned counts_mask, unsigned speeds_mask)
{
    return (counts_mask & 15u) | (speeds_mask & 15u) << 4;
}

static size_t say_hello(const kb_hello *hello, uint8_t out[KB_MAX_FRAME])
{
    uint8_t message[MAX_FIELDS];
    uint8_t *end = put_u8(message, 'H');
    end = put_u8(end, KB_PROTOCOL_VERSION);
    end = put_u32(end, hello->boot);
    end = put_u8(end, hello->counter_bits);
    end = put_u8(end, wheels(hello->counts_mask, hello->speeds_mask));
    end = put_u8(end, (hello->has_steering ? HAS_STEERING : 0u)
                          | (hello->has_yaw_rate ? HAS_YAW_RATE : 0u));
    end = put_u32(end, hello->reading_period_us);
    end = put_u8(end, hello->silence_ms & 255u);
    end = put_u8(end, hello->silence_ms >> 8);
    return kb_seal(message, (size_t)(end - message), out);
}

size_t kb_vehicle_pending(kb_vehicle *vehicle, uint64_t now_ns, uint8_t out[KB_MAX_FRAME])
{
    if (vehicle->refusal != 0) {
        return say_refusal(vehicle, out);
    }
    if (now_ns < vehicle->next_hello_ns) {
        return 0;
    }
    vehicle->next_hello_ns = now_ns + KB_HELLO_PERIOD_NS;
    return say_hello(&vehicle->hello, out);
}

/* The wheels of `mask` whose speed is a number. */
static unsigned finite_speeds(const kb_sensors *sensors, unsigned mask)
{
    unsigned i;
    for (i = 0; i < 4; i++) {
        if (!is_finite(sensors->speeds[i])) {
            mask &= ~(1u << i);
        }
    }
    return mask;
}

static uint8_t *put_wheels(uint8_t *end, const kb_sensors *sensors, unsigned counts,
                           unsigned speeds, int wide)
{
    int i;
    for (i = 0; i < 4; i++) {
        if (counts >> i & 1u) {
            end = wide ? put_u64(end, (uint64_t)sensors->counts[i])
                       : put_u32(end, (uint32_t)sensors->counts[i]);
        }
    }
    for (i = 0; i < 4; i++) {
        if (speeds >> i & 1u) {
            end = put_f32(end, sensors->speeds[i]);
        }
    }
    return end;
}

size_t kb_vehicle_reading(kb_vehicle *vehicle, const kb_sensors *sensors,
                          uint8_t out[KB_MAX_FRAME])
{
    const kb_hello *hello = &vehicle->hello;
    const unsigned counts = sensors->counts_mask & hello->counts_mask & 15u;
    const unsigned speeds = finite_speeds(sensors, sensors->speeds_mask & hello->speeds_mask & 15u);
    const int steering =
        sensors->has_steering && hello->has_steering && is_finite(sensors->steering);
    const int yaw_rate =
        sensors->has_yaw_rate && hello->has_yaw_rate && is_finite(sensors->yaw_rate);
    const int wide = hello->counter_bits > 32;
    const int silent = kb_vehicle_silent(vehicle, sensors->time_ns);
    uint8_t message[MAX_FIELDS];
    uint8_t *end = put_u8(message, 'R');
    end = put_u8(end, (steering ? HAS_STEERING : 0u) | (yaw_rate ? HAS_YAW_RATE : 0u)
                          | (wide ? WIDE : 0u) | (vehicle->started ? ACKNOWLEDGES : 0u)
                          | (silent ? SILENT : 0u));
    end = put_u8(end, wheels(counts, speeds));
    end = put_u32(end, hello->boot);
    end = put_u32(end, vehicle->sequence++);
    end = put_u32(end, vehicle->started ? vehicle->accepted : 0u);
    end = put_u64(end, sensors->time_ns);
    end = put_wheels(end, sensors, counts, speeds, wide);
    if (steering) {
        end = put_f32(end, sensors->steering);
    }
    if (yaw_rate) {
        end = put_f32(end, sensors->yaw_rate);
    }
    return kb_seal(message, (size_t)(end - message), out);
}
