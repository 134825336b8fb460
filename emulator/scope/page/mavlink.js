// MAVLink 2: the few messages that the page needs. Fields stand as they do on the wire, by size.

const TYPES = {
  u8: [1, "Uint8"], i8: [1, "Int8"], u16: [2, "Uint16"], i16: [2, "Int16"], u32: [4, "Uint32"], i32: [4, "Int32"],
  f32: [4, "Float32"], u64: [8, "BigUint64"], text: [1, "Uint8"],
};

// Number: name, CRC_EXTRA, fields as name, type and count.
const MESSAGES = {
  0: ["HEARTBEAT", 50, [["custom_mode", "u32"], ["type", "u8"], ["autopilot", "u8"], ["base_mode", "u8"], ["system_status", "u8"], ["version", "u8"]]],
  20: ["PARAM_REQUEST_READ", 214, [["param_index", "i16"], ["target_system", "u8"], ["target_component", "u8"], ["param_id", "text", 16]]],
  21: ["PARAM_REQUEST_LIST", 159, [["target_system", "u8"], ["target_component", "u8"]]],
  22: ["PARAM_VALUE", 220, [["param_value", "f32"], ["param_count", "u16"], ["param_index", "u16"], ["param_id", "text", 16], ["param_type", "u8"]]],
  23: ["PARAM_SET", 168, [["param_value", "f32"], ["target_system", "u8"], ["target_component", "u8"], ["param_id", "text", 16], ["param_type", "u8"]]],
  76: ["COMMAND_LONG", 152, [["params", "f32", 7], ["command", "u16"], ["target_system", "u8"], ["target_component", "u8"], ["confirmation", "u8"]]],
  77: ["COMMAND_ACK", 143, [["command", "u16"], ["result", "u8"], ["progress", "u8"], ["result_param2", "i32"], ["target_system", "u8"], ["target_component", "u8"]]],
  110: ["FILE_TRANSFER_PROTOCOL", 84, [["target_network", "u8"], ["target_system", "u8"], ["target_component", "u8"], ["payload", "u8", 251]]],
  251: ["NAMED_VALUE_FLOAT", 170, [["time_boot_ms", "u32"], ["value", "f32"], ["signal", "text", 10]]],
  253: ["STATUSTEXT", 83, [["severity", "u8"], ["text", "text", 50], ["id", "u16"], ["chunk_seq", "u8"]]],
  290: ["ESC_INFO", 251, [["time_usec", "u64"], ["error_count", "u32", 4], ["counter", "u16"], ["failure_flags", "u16", 4], ["temperature", "i16", 4], ["index", "u8"], ["count", "u8"], ["connection_type", "u8"], ["info", "u8"]]],
  291: ["ESC_STATUS", 10, [["time_usec", "u64"], ["rpm", "i32", 4], ["voltage", "f32", 4], ["current", "f32", 4], ["index", "u8"]]],
};
const NUMBERS = Object.fromEntries(Object.entries(MESSAGES).map(([number, [name]]) => [name, Number(number)]));
const START = 0xfd;
const HEAD = 10;
const SYSTEM = 255;
const COMPONENT = 191;

function crc(bytes, extra) {
  let sum = 0xffff;
  const take = (byte) => {
    let part = (byte ^ sum) & 0xff;
    part = (part ^ (part << 4)) & 0xff;
    sum = ((sum >> 8) ^ (part << 8) ^ (part << 3) ^ (part >> 4)) & 0xffff;
  };
  bytes.forEach(take);
  take(extra);
  return sum;
}

const length = (fields) => fields.reduce((sum, [, type, count = 1]) => sum + TYPES[type][0] * count, 0);

function read(fields, payload) {
  const bytes = new Uint8Array(length(fields));
  bytes.set(payload.subarray(0, bytes.length));
  const view = new DataView(bytes.buffer);
  const message = {};
  let at = 0;
  for (const [name, type, count] of fields) {
    const [size, kind] = TYPES[type];
    const values = [];
    for (let i = 0; i < (count ?? 1); i++, at += size) values.push(view[`get${kind}`](at, true));
    if (type === "text") {
      const end = values.indexOf(0);
      message[name] = new TextDecoder().decode(new Uint8Array(end < 0 ? values : values.slice(0, end)));
    } else {
      message[name] = count === undefined ? values[0] : values;
    }
  }
  return message;
}

function write(fields, message) {
  const bytes = new Uint8Array(length(fields));
  const view = new DataView(bytes.buffer);
  let at = 0;
  for (const [name, type, count = 1] of fields) {
    const [size, kind] = TYPES[type];
    let values = message[name] ?? 0;
    if (type === "text") values = new TextEncoder().encode(values);
    if (typeof values === "number") values = [values];
    for (let i = 0; i < count; i++, at += size) view[`set${kind}`](at, values[i] ?? 0, true);
  }
  return bytes;
}

let sequence = 0;

/** The frame of a message. */
export function encode(name, message) {
  const number = NUMBERS[name];
  const [, extra, fields] = MESSAGES[number];
  let payload = write(fields, message);
  let end = payload.length;
  while (end > 1 && payload[end - 1] === 0) end--;
  payload = payload.subarray(0, end);
  const frame = new Uint8Array(HEAD + end + 2);
  frame.set([START, end, 0, 0, sequence++ & 0xff, SYSTEM, COMPONENT, number & 0xff, number >> 8, 0]);
  frame.set(payload, HEAD);
  new DataView(frame.buffer).setUint16(HEAD + end, crc(frame.subarray(1, HEAD + end), extra), true);
  return frame;
}

/** The messages in whole frames that follow each other, each with its name and sender. */
export function* decode(bytes) {
  let at = 0;
  while (at + HEAD + 2 <= bytes.length) {
    const [start, size, incompatible] = bytes.subarray(at);
    const end = at + HEAD + size + 2;
    if (start !== START || end > bytes.length) {
      at++;
      continue;
    }
    const number = bytes[at + 7] | (bytes[at + 8] << 8) | (bytes[at + 9] << 16);
    const known = MESSAGES[number];
    if (known) {
      const sum = bytes[end - 2] | (bytes[end - 1] << 8);
      if (sum !== crc(bytes.subarray(at + 1, end - 2), known[1])) {
        at++;
        continue;
      }
      const message = read(known[2], bytes.subarray(at + HEAD, end - 2));
      yield { name: known[0], system: bytes[at + 5], component: bytes[at + 6], ...message };
    }
    at = end + (incompatible & 1 ? 13 : 0);
  }
}
