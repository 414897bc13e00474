!> What a value looks like that the user has not given, and how long names may be.
module pd_scene_format_given
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: is_set, is_given, name_length, path_length, text_length, unset

  integer, parameter :: name_length = 64    !! longest name of a body, region, ... [characters]
  integer, parameter :: path_length = 1024  !! longest file name [characters]
  integer, parameter :: text_length = 1024  !! longest expression [characters]
  real(wp), parameter :: unset = -huge(1.0_wp)  !! a real the user has not given

contains

  !> Whether the user has given this value. A value that is no number has been given, so that it is
  !> refused where it matters.
  elemental logical function is_set(value)
    real(wp), intent(in) :: value  !! of a real key
    is_set = ieee_is_nan(value)
    if (.not. is_set) is_set = value > unset .or. value < unset
  end function is_set

  !> Whether the user has given a key that may be a number or an expression.
  elemental logical function is_given(value, text)
    real(wp), intent(in) :: value     !! the number, or `unset`
    character(*), intent(in) :: text  !! the expression, '' for none
    is_given = is_set(value) .or. text /= ''
  end function is_given

end module pd_scene_format_given
