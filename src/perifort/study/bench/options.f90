!> What the benchmark shall measure, and whether that makes sense.
module pd_study_bench_options
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: join, nearest_name, to_text
  implicit none (type, external)
  private
  public :: bench_options_type, check_options, chosen, given, models, families, switches, &
    & precisions

  character(*), parameter :: models(2) = ['state_based', 'bond_based ']   !! of `model`
  character(*), parameter :: families(2) = ['lattice', 'list   ']         !! of `family`
  character(*), parameter :: switches(2) = ['off', 'on ']                 !! of `breaking`

  character(*), parameter :: precisions(2) = ['double', 'mixed ']         !! of `precision`

  !> What to measure. Unallocated, or '' for words, means the default.
  type :: bench_options_type
    integer, allocatable :: points(:)        !! along an edge; default 1000, 500, 80 in 1D to 3D
    integer, allocatable :: dimensions(:)    !! default 3, 2, 1
    integer, allocatable :: threads(:)       !! default 1 and all, bars 1; 1 is always measured
    character(:), allocatable :: model       !! one of `models` or 'both', the default
    character(:), allocatable :: family      !! one of `families` or 'both', the default
    character(:), allocatable :: breaking    !! one of `switches` or 'both'; default: lists 'off'
    character(:), allocatable :: precision   !! one of `precisions`, default 'double', or 'both'
    character(:), allocatable :: csv         !! file for the numbers, '' for none
    logical :: surface = .false.             !! with surface correction
    logical :: generic = .false.             !! the laws on the generic pass
    real(wp) :: seconds = 0.25_wp            !! each repeat takes at least so long [s]
    integer(i8) :: triad = 16000000_i8       !! elements of each of the arrays for the bandwidth
  end type bench_options_type

contains

  !> An error if an option has a value that cannot be measured.
  pure subroutine check_options(options, error)
    type(bench_options_type), intent(in) :: options  !! what the user asks for
    type(error_type), allocatable, intent(out) :: error

    call check_range('--points', options%points, 8, 1000000000, error)
    if (allocated(error)) return
    call check_range('--dimension', options%dimensions, 1, 3, error)
    if (allocated(error)) return
    call check_range('--threads', options%threads, 1, 999999, error)
    if (allocated(error)) return
    call check_choice('--model', options%model, models, error)
    if (allocated(error)) return
    call check_choice('--family', options%family, families, error)
    if (allocated(error)) return
    call check_choice('--breaking', options%breaking, switches, error)
    if (allocated(error)) return
    call check_choice('--precision', options%precision, precisions, error)
    if (allocated(error)) return
    if (given(options%precision)) then
      if (options%precision == 'mixed') call check_mixed(options, error)
      if (allocated(error)) return
    end if
    if (.not. (options%seconds >= 0.001_wp .and. options%seconds <= 3600.0_wp)) &
      & call fail(error, "'--seconds' must be between 0.001 and 3600, found "// &
      & to_text(options%seconds))
  end subroutine check_options

  !> Fails if none of the selected kernels has loops in mixed precision.
  pure subroutine check_mixed(options, error)
    type(bench_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    logical :: bars

    bars = .false.
    if (allocated(options%dimensions)) bars = all(options%dimensions == 1)
    if (bars .or. .not. chosen(options%family, 'lattice')) &
      & call fail(error, "'--precision' mixed is for lattices in 2D and 3D")
  end subroutine check_mixed

  !> Every one of `values`, if they are given, must lie between `least` and `most`.
  pure subroutine check_range(option, values, least, most, error)
    character(*), intent(in) :: option
    integer, allocatable, intent(in) :: values(:)
    integer, intent(in) :: least, most
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    if (.not. allocated(values)) return
    do i = 1, size(values)
      if (values(i) >= least .and. values(i) <= most) cycle
      call fail(error, "'"//option//"' must be between "//to_text(least)//' and '//to_text(most)// &
        & ', found '//to_text(values(i)))
      return
    end do
  end subroutine check_range

  !> A word must be one of `words`, or 'both', or not given.
  pure subroutine check_choice(option, word, words, error)
    character(*), intent(in) :: option, words(:)
    character(:), allocatable, intent(in) :: word
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: hint

    if (.not. given(word)) return
    if (word == 'both' .or. any(words == word)) return
    hint = nearest_name(word, words)
    if (len(hint) > 0) hint = "; did you mean '"//hint//"'?"
    call fail(error, "'"//option//"' must be "//join(words, ', ')//" or both, found '"//word// &
      & "'"//hint)
  end subroutine check_choice

  !> Whether `name` is among the chosen ones: the word itself, 'both', or nothing given.
  pure logical function chosen(word, name)
    character(:), allocatable, intent(in) :: word  !! as the user gave it; '' or not allocated:
                                                   !! nothing given
    character(*), intent(in) :: name               !! of one choice

    chosen = .true.
    if (given(word)) chosen = word == 'both' .or. word == name
  end function chosen

  !> Whether there is a word.
  pure logical function given(word)
    character(:), allocatable, intent(in) :: word  !! as the user gave it; may be not allocated
    given = .false.
    if (allocated(word)) given = len_trim(word) > 0
  end function given

end module pd_study_bench_options
