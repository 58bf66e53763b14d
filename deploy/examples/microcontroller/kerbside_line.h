/*
 * The vehicle's end of the kerbside line protocol, version 1. README.md describes the protocol.
 *
 * C99, no allocation, nothing but <stdint.h>, <stddef.h> and <string.h>. Nothing here does I/O or
 * reads a clock: bytes and the vehicle's own time [ns since its start] go in, frames come out.
 * Not for concurrent use: call from one context, and let the receive interrupt fill a queue.
 *
 * SPDX-License-Identifier: Apache-2.0 OR MIT
 */
#ifndef KERBSIDE_LINE_H
#define KERBSIDE_LINE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef KB_PROTOCOL_VERSION
#define KB_PROTOCOL_VERSION 1
#endif

/* Longest frame on the wire, with the delimiters on both sides [bytes]. */
#define KB_MAX_FRAME 86
/* Longest run of bytes between two delimiters. */
#define KB_MAX_ENCODED (KB_MAX_FRAME - 2)
/* Time between two HELLO [ns]. */
#define KB_HELLO_PERIOD_NS 50000000u

/* Wheels, as bits of a mask. */
#define KB_FL 1u
#define KB_FR 2u
#define KB_RL 4u
#define KB_RR 8u

/* What the vehicle says of itself. */
typedef struct {
    uint32_t boot;              /* another number at each start: the counters start anew */
    uint8_t counter_bits;       /* width of the wheel counters, 1 to 64 */
    uint8_t counts_mask;        /* wheels with a counter */
    uint8_t speeds_mask;        /* wheels that report a speed */
    uint8_t has_steering;       /* 1: there is a steering sensor */
    uint8_t has_yaw_rate;       /* 1: there is a gyro */
    uint32_t reading_period_us; /* nominal time between readings [us] */
    uint16_t silence_ms;        /* without a command for so long the vehicle stops [ms] */
} kb_hello;

/* What the sensors say at one instant. */
typedef struct {
    uint64_t time_ns;     /* when they were read, the vehicle's own time */
    uint8_t counts_mask;  /* wheels whose count was read */
    int64_t counts[4];    /* fl, fr, rl, rr, cumulative, forward positive; low counter_bits count */
    uint8_t speeds_mask;  /* wheels whose speed was read */
    float speeds[4];      /* surface speeds [m/s] */
    uint8_t has_steering; /* 1: steering was read */
    float steering;       /* road-wheel angle, left positive [rad] */
    uint8_t has_yaw_rate; /* 1: yaw_rate was read */
    float yaw_rate;       /* counter-clockwise positive [rad/s] */
} kb_sensors;

/* What the host asks of the actuators. */
typedef struct {
    uint32_t sequence;
    float speed;    /* of the rear-axle centre [m/s] */
    float steering; /* road-wheel angle, left positive [rad] */
} kb_command;

/* What a received byte completed. */
typedef enum {
    KB_NOTHING = 0, /* nothing that counts */
    KB_STARTED,     /* a host began a session; nothing moves yet */
    KB_COMMANDED,   /* a command, to be obeyed */
    KB_REFUSED      /* a host of another version, or one that means an earlier life */
} kb_event;

/* The vehicle's end. Its fields are its own; the two counters may be read. */
typedef struct {
    uint32_t line_errors; /* frames refused since the start */
    uint32_t ignored;     /* well-formed commands outside a session, or repeated */

    kb_hello hello;
    uint8_t buffer[KB_MAX_ENCODED];
    uint8_t length;
    uint8_t overlong;
    uint8_t started;
    uint8_t commanded;
    uint8_t refusal; /* reason owed to the host; 0 for none */
    uint8_t asked_version;
    uint32_t asked_boot;
    uint32_t accepted;
    uint32_t sequence;
    uint64_t commanded_ns;
    uint64_t next_hello_ns;
} kb_vehicle;

/* Prepares an end for the vehicle that `hello` describes. Call once at the start. */
void kb_vehicle_init(kb_vehicle *vehicle, const kb_hello *hello);

/* Takes one byte from the line. `command` is written where the result is KB_COMMANDED. */
kb_event kb_vehicle_receive(kb_vehicle *vehicle, uint64_t now_ns, uint8_t byte,
                            kb_command *command);

/*
 * A frame that is to be written now: the answer to a refused START, or the HELLO that is due.
 * Returns its length, 0 if there is none; call again until it is 0.
 */
size_t kb_vehicle_pending(kb_vehicle *vehicle, uint64_t now_ns, uint8_t out[KB_MAX_FRAME]);

/*
 * The frame of the next reading; returns its length. It carries what the HELLO declared of what
 * `sensors` has, and no number that is not finite.
 */
size_t kb_vehicle_reading(kb_vehicle *vehicle, const kb_sensors *sensors,
                          uint8_t out[KB_MAX_FRAME]);

/* 1: no command for the silence time-out, or none at all in this session. Stop the vehicle. */
int kb_vehicle_silent(const kb_vehicle *vehicle, uint64_t now_ns);

/* Building blocks, of use to a host's end. */

/* CRC-32 (ISO-HDLC), as in Ethernet and zip. */
uint32_t kb_crc32(const uint8_t *bytes, size_t length);

/*
 * Puts check sum, COBS and delimiters around `message` of at most KB_MAX_FRAME - 7 bytes. Returns
 * the frame's length.
 */
size_t kb_seal(const uint8_t *message, size_t length, uint8_t out[KB_MAX_FRAME]);

/*
 * Unpacks, in place, what stood between two delimiters. Returns the message's length, 0 if it is
 * none.
 */
size_t kb_open(uint8_t *encoded, size_t length);

#ifdef __cplusplus
}
#endif

#endif
