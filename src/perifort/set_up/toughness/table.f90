!> Toughnesses of usual lattices, so that runs need no solve (`pd_set_up_toughness_grow`).
!>
!> `./pf verify toughness --write` computes the rows, independently of the program, and writes them.
module pd_set_up_toughness_table
  use pd_base_kinds, only: wp
  use pd_family_volume, only: volume_exact, volume_linear, volume_linear_extended, volume_none
  use pd_law_weighted, only: weighted_law_type
  use pd_set_up_toughness_grow, only: subject_type
  implicit none (type, external)
  private
  public :: look_up, row_type, rows

  real(wp), parameter :: same = 1.0e-7_wp  !! how far numbers of a row and of a scene may differ

  !> A lattice in 2D or 3D, surface factors of whole families, influence 'inverse'.
  type :: row_type
    integer :: dim = 2                      !! 2 or 3
    logical :: plane_strain = .false.       !! 2D
    integer :: volume = volume_linear       !! volume correction
    real(wp) :: horizon = 0.0_wp            !! [spacings]
    real(wp) :: poissons_ratio = 0.0_wp     !! [-]
    real(wp) :: largest = 0.0_wp            !! largest G/Gc within a period
    real(wp) :: mean = 0.0_wp               !! mean G/Gc
    real(wp) :: diagonal = 0.0_wp           !! largest G/Gc along diagonals of cells
  end type row_type

  logical, parameter :: stress = .false., strain = .true.

  ! rows begin here
  type(row_type), parameter :: rows(*) = [ &
    & row_type(2, stress, volume_linear, 3.015_wp, 1/3.0_wp, 1.5189_wp, 1.1625_wp, 1.4575_wp)]
  ! rows end here

contains

  !> The toughness of a lattice, if it is in the table.
  pure subroutine look_up(law, subject, largest, mean, diagonal, found)
    class(weighted_law_type), intent(in) :: law  !! with its Poisson's ratio and influence
    type(subject_type), intent(in) :: subject    !! the lattice
    real(wp), intent(out) :: largest   !! largest G/Gc within a period; 0 if not found
    real(wp), intent(out) :: mean      !! mean G/Gc; 0 if not found
    real(wp), intent(out) :: diagonal  !! largest G/Gc along diagonals of cells; 0 if not found
    logical, intent(out) :: found      !! the lattice is in the table
    type(row_type) :: row
    integer :: i

    largest = 0.0_wp
    mean = 0.0_wp
    diagonal = 0.0_wp
    found = .false.
    if (law%has_factors()) return
    ! without a dilatation surface factors multiply all forces alike
    if (.not. subject%corrected .and. abs(law%material%a) > 0.0_wp) return
    do i = 1, size(rows)
      row = rows(i)
      if (row%dim /= subject%dim .or. row%volume /= subject%rule%kind) cycle
      if (row%dim == 2 .and. (row%plane_strain .neqv. subject%plane_strain)) cycle
      if (abs(row%horizon - subject%rule%delta) > same) cycle
      if (abs(row%poissons_ratio - law%material%poissons_ratio) > same) cycle
      largest = row%largest
      mean = row%mean
      diagonal = row%diagonal
      found = .true.
      return
    end do
  end subroutine look_up

end module pd_set_up_toughness_table
