// MessagePack <-> what a tester and the nodes say to each other beside the messages under test: no more of it than they
// use (integers, texts, bytes, arrays). A frame is an array that begins with its name.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace parcours {

/// What the tester cannot go on after: no verdict on the nodes under test.
struct HostError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Values -> MessagePack.
class Packer {
 public:
  Packer& array(std::size_t n) { return n < 16 ? byte(0x90 | n) : number(0xdc, n, 2); }
  Packer& nil() { return byte(0xc0); }
  Packer& integer(std::int64_t value) {
    if (value >= 0 && value < 128) return byte(static_cast<std::uint8_t>(value));
    return number(0xd3, static_cast<std::uint64_t>(value), 8);
  }
  Packer& text(std::string_view value) {
    if (value.size() < 32) byte(0xa0 | value.size()); else number(0xdb, value.size(), 4);
    packed_.append(value);
    return *this;
  }
  Packer& bytes(std::string_view value) {
    number(0xc6, value.size(), 4);
    packed_.append(value);
    return *this;
  }
  const std::string& packed() const { return packed_; }

 private:
  Packer& byte(std::size_t value) {
    packed_.push_back(static_cast<char>(value));
    return *this;
  }
  Packer& number(std::uint8_t head, std::uint64_t value, int n_bytes) {
    byte(head);
    for (int k = n_bytes - 1; k >= 0; --k) byte((value >> (8 * k)) & 0xff);
    return *this;
  }
  std::string packed_;
};

/// A value that was read.
struct Value {
  enum class Kind { nil, integer, text, array } kind = Kind::nil;  // text is text or bytes
  std::int64_t integer = 0;
  std::string text;
  std::vector<Value> items;
};

/// MessagePack -> one value. Throws HostError if the bytes are something else.
class Unpacker {
 public:
  static Value value_of(std::string_view data) {
    Unpacker reader(data);
    Value value = reader.value(0);
    if (reader.at_ != data.size()) reader.refuse();
    return value;
  }

 private:
  explicit Unpacker(std::string_view data) : data_(data) {}

  Value value(int depth) {
    if (depth > 8) refuse();
    const std::uint8_t head = static_cast<std::uint8_t>(take(1)[0]);
    if (head < 0x80) return integer(head);
    if (head >= 0xe0) return integer(static_cast<std::int8_t>(head));
    if (head >= 0xa0 && head < 0xc0) return text(head & 0x1f);
    if (head >= 0x90 && head < 0xa0) return array(head & 0x0f, depth);
    if (head >= 0x80 && head < 0x90) return array(2 * (head & 0x0f), depth);  // a map: what a component reports
    switch (head) {
      case 0xc0: return Value{};
      case 0xc2: return integer(0);
      case 0xc3: return integer(1);
      case 0xca: take(4); return Value{};
      case 0xcb: take(8); return Value{};
      case 0xc4: case 0xd9: return text(number(1));
      case 0xc5: case 0xda: return text(number(2));
      case 0xc6: case 0xdb: return text(number(4));
      case 0xcc: return integer(number(1));
      case 0xcd: return integer(number(2));
      case 0xce: return integer(number(4));
      case 0xcf: case 0xd3: return integer(static_cast<std::int64_t>(number(8)));
      case 0xd0: return integer(static_cast<std::int8_t>(number(1)));
      case 0xd1: return integer(static_cast<std::int16_t>(number(2)));
      case 0xd2: return integer(static_cast<std::int32_t>(number(4)));
      case 0xdc: return array(number(2), depth);
      case 0xdd: return array(number(4), depth);
      case 0xde: return array(2 * number(2), depth);
      default: refuse();
    }
  }

  [[noreturn]] void refuse() const {
    throw HostError("a node's report is no frame of this version: " + std::to_string(data_.size()) + " bytes, at " +
                    std::to_string(at_));
  }
  std::string_view take(std::size_t n) {
    if (n > data_.size() - at_) refuse();
    at_ += n;
    return data_.substr(at_ - n, n);
  }
  std::uint64_t number(int n_bytes) {
    std::uint64_t value = 0;
    for (char one : take(n_bytes)) value = value << 8 | static_cast<std::uint8_t>(one);
    return value;
  }
  static Value integer(std::int64_t number) { return Value{Value::Kind::integer, number, {}, {}}; }
  Value text(std::size_t size) { return Value{Value::Kind::text, 0, std::string(take(size)), {}}; }
  Value array(std::size_t size, int depth) {
    Value found{Value::Kind::array, 0, {}, {}};
    for (std::size_t k = 0; k < size; ++k) found.items.push_back(value(depth + 1));
    return found;
  }

  std::string_view data_;
  std::size_t at_ = 0;
};

/// A message: its channel, that channel's place in the table (-1 if the model has none such), and its bytes as ROS 1
/// serialises them.
struct Message {
  std::string name;
  int channel = -1;
  std::string data;
};

/// What a node has said. `kind` is its name: Ready, Turned, ViewShown, or Died, which the tester says of it.
struct Report {
  std::string node, kind;
  int reference = -1;
  std::string manner, transition, text;       // of Turned
  std::int64_t time = 0, received = -1;       // of Turned [ns since the case began]
  std::vector<Message> sends;                 // of Turned; of ViewShown what is shown, if anything
  std::vector<std::pair<std::int64_t, Message>> asides;
};

}  // namespace parcours
