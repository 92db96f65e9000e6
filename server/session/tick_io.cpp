#include "server/session/tick_io.h"

#include "idl/types/bytes.h"

namespace tenon::session {
namespace {

void put(ByteWriter& out, const HandReading& reading) {
  out.put(reading.hand), out.put(reading.seq), out.put(reading.active);
  out.put(reading.X_WH), out.put(reading.V_WH), out.put(reading.buttons);
}

void get(ByteReader& in, HandReading& reading) {
  in.get(reading.hand), in.get(reading.seq), in.get(reading.active);
  in.get(reading.X_WH), in.get(reading.V_WH), in.get(reading.buttons);
}

void put(ByteWriter& out, const Change& change) {
  out.put(change.kind), out.put(change.hand), out.put(change.object), out.put(change.index);
  out.put(change.lifetime_ticks), out.put(change.value);
  out.put(change.stiffness.translational), out.put(change.stiffness.rotational);
  out.put(change.game.kind), out.put(change.game.hand), out.put(change.game.signal),
      out.put(change.game.value);
  out.put(change.F_Oo_W), out.put(change.X_WO);
}

void get(ByteReader& in, Change& change) {
  in.get(change.kind), in.get(change.hand), in.get(change.object), in.get(change.index);
  in.get(change.lifetime_ticks), in.get(change.value);
  in.get(change.stiffness.translational), in.get(change.stiffness.rotational);
  in.get(change.game.kind), in.get(change.game.hand), in.get(change.game.signal), in.get(change.game.value);
  in.get(change.F_Oo_W), in.get(change.X_WO);
}

template <typename T, std::size_t N>
void putList(ByteWriter& out, const FixedVector<T, N>& list) {
  out.put(static_cast<std::uint8_t>(list.size()));
  for (const T& entry : list) put(out, entry);
}

template <typename T, std::size_t N>
bool getList(ByteReader& in, FixedVector<T, N>& list) {
  std::uint8_t count = 0;
  in.get(count);
  for (int i = 0; i < count && in.ok(); ++i) {
    T entry;
    get(in, entry);
    if (!list.push_back(entry)) return false;
  }
  return true;
}

}  // namespace

void appendBytes(const TickInput& input, std::vector<std::uint8_t>& bytes) {
  ByteWriter out(bytes);
  out.put(input.tick);
  putList(out, input.readings);
  putList(out, input.changes);
}

Result<TickInput> readTickInput(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  TickInput input;
  in.get(input.tick);
  if (!getList(in, input.readings) || !getList(in, input.changes) || !in.ok() || !in.atEnd())
    return fail("the input of a tick in the journal is damaged (" + std::to_string(bytes.size()) + " bytes)");
  return input;
}

}  // namespace tenon::session
