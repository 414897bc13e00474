!> The kinds of numbers, in one place.
module pd_base_kinds
  use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64
  implicit none (type, external)
  private
  public :: wp, sp, i1, i2, i4, i8

  integer, parameter :: wp = real64  !! working precision of state and arithmetic
  integer, parameter :: sp = real32  !! single precision, for output and bonds that ask for it
  integer, parameter :: i1 = int8    !! flags
  integer, parameter :: i2 = int16   !! numbers of bodies, materials and layers at a point
  integer, parameter :: i4 = int32   !! indices of points
  integer, parameter :: i8 = int64   !! counts of bonds

end module pd_base_kinds
