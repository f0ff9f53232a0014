#pragma once

#include <boost/outcome/basic_result.hpp>
#include <boost/outcome/policy/throw_bad_result_access.hpp>
#include <boost/outcome/try.hpp>
#include <string>
#include <utility>

namespace spectra::store {

/// Why the store did not do what it was asked for. The numbers are a contract (logs, scripts): never reused, never renumbered.
enum class StoreErrorCode : int {
  InvalidRecord = 600,  ///< What is put cannot be meant: an id of other characters, a number that is none.
  NotFound = 601,       ///< No such block, revision or file.
  TooLarge = 602,       ///< A block beyond what one row of the store can hold.
  Busy = 603,           ///< More bytes wait than the store may hold; come again when some are written.
  HistoryGone = 604,    ///< The time lies before what the history still holds.
  DiskFull = 610,       ///< No room (or no quota) for what was to be written; it may be tried again.
  ReadOnly = 611,
  IoError = 612,
  Locked = 613,        ///< Another process has the store open.
  Foreign = 620,       ///< The file is something else.
  NewerVersion = 621,  ///< Written by a program that knows more than this one.
  Damaged = 622,       ///< What is there is not what was written.
  Closed = 630,        ///< close() was called before.
};

/// An expected failure: what, in one sentence for a person that says the way out where there is one.
struct StoreError {
  StoreErrorCode code;
  std::string message;
};

/// A value or a StoreError; asking for the value of an error throws boost::outcome_v2::bad_result_access.
template <class T>
using StoreResult = BOOST_OUTCOME_V2_NAMESPACE::basic_result<
    T, StoreError, BOOST_OUTCOME_V2_NAMESPACE::policy::throw_bad_result_access<StoreError, void>>;

/// The error side of any StoreResult.
inline auto failure(StoreErrorCode code, std::string message) {
  return BOOST_OUTCOME_V2_NAMESPACE::failure(StoreError{code, std::move(message)});
}

/// The success side of a StoreResult<void>.
inline auto success() {
  return BOOST_OUTCOME_V2_NAMESPACE::success();
}

}  // namespace spectra::store
