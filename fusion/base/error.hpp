#pragma once

#include <boost/outcome/basic_result.hpp>
#include <boost/outcome/policy/throw_bad_result_access.hpp>
#include <boost/outcome/try.hpp>
#include <string>
#include <utility>

namespace spectra::base {

/// What went wrong. The numbers are a contract (exit messages, logs, scripts): never reused, never renumbered.
enum class ErrorCode : int {
  UnknownMethod = 100,
  UnknownParameter = 101,
  WrongType = 102,
  OutOfRange = 103,
  Inconsistent = 104,  ///< Each value is allowed, their combination is not (low > high).
  UnknownPalette = 105,
  FileNotFound = 200,
  FileUnreadable = 201,
  FileUnwritable = 202,
  BadHeader = 210,    ///< The file does not start as its format demands.
  Truncated = 211,    ///< Fewer bytes than the header promises.
  BadValue = 212,     ///< A value in the body that cannot be meant (NaN position, index out of range).
  Unsupported = 213,  ///< Well-formed, but outside what Spectra reads.
  TooLarge = 214,
};

/// An expected failure: what, where (the parameter, property or file position it is about; may be empty).
struct Error {
  ErrorCode code;
  std::string message;  ///< One sentence for a person, naming value and limits.
  std::string field;    ///< The parameter, property or file it is about.
};

/// A value or an Error; asking for the value of an error throws boost::outcome_v2::bad_result_access.
template <class T>
using Result =
    BOOST_OUTCOME_V2_NAMESPACE::basic_result<T, Error,
                                             BOOST_OUTCOME_V2_NAMESPACE::policy::throw_bad_result_access<Error, void>>;

/// The error side of any Result: `return failure(ErrorCode::OutOfRange, "...", "alpha");`
inline auto failure(ErrorCode code, std::string message, std::string field = {}) {
  return BOOST_OUTCOME_V2_NAMESPACE::failure(Error{code, std::move(message), std::move(field)});
}

/// The success side of a Result<void>.
inline auto success() {
  return BOOST_OUTCOME_V2_NAMESPACE::success();
}

}  // namespace spectra::base
