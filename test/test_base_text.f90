!> Text: numbers as words, units, nearest names.
module test_base_text
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: counted, edit_distance, join, lower_case, nearest_name, to_text, with_unit
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_text

contains

  subroutine collect_base_text(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('integers are written without blanks', test_integers), &
      & new_unittest('reals are written short', test_reals), &
      & new_unittest('reals are read back as they were', test_read_back), &
      & new_unittest('values carry an SI prefix', test_units), &
      & new_unittest('letters become lower case', test_lower_case), &
      & new_unittest('distances of words', test_distance), &
      & new_unittest('a distance is symmetric', test_symmetry), &
      & new_unittest('the nearest name is found', test_nearest), &
      & new_unittest('a very different name has no suggestion', test_far), &
      & new_unittest('things are counted', test_counted), &
      & new_unittest('names are joined', test_join)]
  end subroutine collect_base_text

  subroutine test_integers(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, to_text(0), '0')
    if (allocated(error)) return
    call check(error, to_text(-17), '-17')
    if (allocated(error)) return
    call check(error, to_text(123456789012345_i8), '123456789012345')
    if (allocated(error)) return
    call check(error, to_text(.true.)//to_text(.false.), 'truefalse')
  end subroutine test_integers

  subroutine test_reals(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, to_text(0.25_wp), '0.25')
    if (allocated(error)) return
    call check(error, to_text(0.0_wp), '0')
    if (allocated(error)) return
    call check(error, to_text(2.0e11_wp), '2e11')
    if (allocated(error)) return
    call check(error, to_text(-1.25e-7_wp), '-1.25e-7')
    if (allocated(error)) return
    call check(error, to_text(7850.0_wp), '7850')
    if (allocated(error)) return
    call check(error, to_text(3.14159265358979_wp, 3), '3.14')
  end subroutine test_reals

  subroutine test_read_back(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: value, again
    integer :: exponent, status
    character(:), allocatable :: text

    do exponent = -300, 300, 7
      value = -1.2345678901_wp*10.0_wp**exponent
      text = to_text(value, 12)
      read (text, *, iostat=status) again
      call check(error, status, 0, 'cannot be read: '//text)
      if (allocated(error)) return
      call check(error, again, value, thr=1.0e-11_wp, rel=.true., more=text)
      if (allocated(error)) return
    end do
  end subroutine test_read_back

  subroutine test_units(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, with_unit(1.946e-7_wp, 's'), '194.6 ns')
    if (allocated(error)) return
    call check(error, with_unit(2.0e11_wp, 'Pa'), '200 GPa')
    if (allocated(error)) return
    call check(error, with_unit(1.0e3_wp, 'm'), '1 km')
    if (allocated(error)) return
    call check(error, with_unit(0.0_wp, 'm'), '0 m')
    if (allocated(error)) return
    call check(error, with_unit(-3.0_wp, 'J'), '-3 J')
  end subroutine test_units

  subroutine test_lower_case(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, lower_case('Youngs_MODULUS 1@[Z'), 'youngs_modulus 1@[z')
  end subroutine test_lower_case

  subroutine test_distance(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, edit_distance('steps', 'steps'), 0)
    if (allocated(error)) return
    call check(error, edit_distance('', 'abc'), 3)
    if (allocated(error)) return
    call check(error, edit_distance('stps', 'steps'), 1, 'a letter left out')
    if (allocated(error)) return
    call check(error, edit_distance('sreps', 'steps'), 1, 'a letter replaced')
    if (allocated(error)) return
    call check(error, edit_distance('setps', 'steps'), 1, 'two letters swapped')
    if (allocated(error)) return
    call check(error, edit_distance('kitten', 'sitting'), 3)
  end subroutine test_distance

  subroutine test_symmetry(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: words(5) = ['horizon   ', 'horizno   ', 'ratio     ', 'dilatation', &
      & 'duration  ']
    integer :: i, j
    do i = 1, size(words)
      do j = 1, size(words)
        call check(error, edit_distance(trim(words(i)), trim(words(j))), &
          & edit_distance(trim(words(j)), trim(words(i))), trim(words(i))//', '//trim(words(j)))
        if (allocated(error)) return
      end do
    end do
  end subroutine test_symmetry

  subroutine test_nearest(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: known(3) = ['integrator', 'steps     ', 'duration  ']
    call check(error, nearest_name('stps', known), 'steps')
    if (allocated(error)) return
    call check(error, nearest_name('DURATOIN', known), 'duration')
    if (allocated(error)) return
    call check(error, nearest_name('integrater', known), 'integrator')
  end subroutine test_nearest

  subroutine test_far(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: known(2) = ['integrator', 'duration  ']
    call check(error, len(nearest_name('poissons_ratio', known)), 0)
  end subroutine test_far

  subroutine test_counted(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, counted(1, 'point'), '1 point')
    if (allocated(error)) return
    call check(error, counted(0, 'point')//', '//counted(12, 'step'), '0 points, 12 steps')
  end subroutine test_counted

  subroutine test_join(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: names(3) = ['a  ', 'bcd', 'ef ']
    call check(error, join(names, ', '), 'a, bcd, ef')
    if (allocated(error)) return
    call check(error, len(join(names(:0), ', ')), 0)
  end subroutine test_join

end module test_base_text
