// What an engine must offer to be recorded, replayed, resumed and forked. varve's own engine is
// adapted to it in tools/; a foreign one implements it and needs nothing else of varve.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/frame.h"

namespace varve::io {

/// A key and its new value, as text.
using Setting = std::pair<std::string, std::string>;

class Engine {
 public:
  virtual ~Engine() = default;

  /// Fields and tables; constant while the engine lives.
  virtual const Schema& schema() const = 0;

  /// The state after the last completed step. Valid until the next advance(), restore() or
  /// change().
  virtual FrameView frame() const = 0;

  /// What happened at the end of the last completed step (changes of parameters, particles added).
  virtual const std::vector<Event>& events() const = 0;

  /// Does exactly one step.
  virtual void advance() = 0;

  /// Takes a state that this schema describes; throws LogError(mismatch) if it does not fit.
  virtual void restore(const FrameView& frame) = 0;

  /// Changes parameters now, at the end of the last completed step; throws if a key may not change.
  virtual void change(const std::vector<Setting>& settings) = 0;
};

}  // namespace varve::io
