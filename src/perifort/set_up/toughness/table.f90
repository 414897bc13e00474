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

  !> A lattice in 2D or 3D, with the surface factors of whole families and influence 'inverse'.
  !> Plane strain at nu is plane stress at nu/(1 - nu): the moduli within the plane are the same.
  type :: row_type
    integer :: dim = 2                      !! 2 or 3
    integer :: volume = volume_linear       !! volume correction
    real(wp) :: horizon = 0.0_wp            !! [spacings]
    real(wp) :: poissons_ratio = 0.0_wp     !! of 3D or plane stress [-]
    real(wp) :: largest = 0.0_wp            !! largest G/Gc within a period
    real(wp) :: mean = 0.0_wp               !! mean G/Gc
    real(wp) :: diagonal = 0.0_wp           !! largest G/Gc along diagonals of cells
  end type row_type

  ! rows begin here
  type(row_type), parameter :: rows(*) = [ &
    & row_type(2, volume_linear, 3.015_wp, 0.2_wp, 1.3207_wp, 1.0641_wp, 1.2640_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.22_wp, 1.3515_wp, 1.0807_wp, 1.2915_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.25_wp, 1.3987_wp, 1.1025_wp, 1.3337_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.3_wp, 1.4773_wp, 1.1378_wp, 1.4068_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.33_wp, 1.5147_wp, 1.1600_wp, 1.4524_wp), &
    & row_type(2, volume_linear, 3.015_wp, 1/3.0_wp, 1.5189_wp, 1.1625_wp, 1.4575_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.35_wp, 1.5398_wp, 1.1746_wp, 1.4835_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.4_wp, 1.6027_wp, 1.2101_wp, 1.5644_wp), &
    & row_type(2, volume_linear, 3.015_wp, 3/7.0_wp, 1.6388_wp, 1.2296_wp, 1.6126_wp), &
    & row_type(2, volume_linear, 3.015_wp, 0.5_wp, 1.7282_wp, 1.2747_wp, 1.7402_wp), &
    & row_type(2, volume_linear, 3.015_wp, 2/3.0_wp, 1.9161_wp, 1.3417_wp, 2.1059_wp), &
    & row_type(2, volume_none, 3.015_wp, 1/3.0_wp, 1.5188_wp, 1.2151_wp, 1.3557_wp), &
    & row_type(2, volume_linear_extended, 3.015_wp, 1/3.0_wp, 1.4830_wp, 1.2000_wp, 1.4054_wp), &
    & row_type(2, volume_exact, 3.015_wp, 1/3.0_wp, 1.5016_wp, 1.2093_wp, 1.3948_wp), &
    & row_type(2, volume_linear, 4.015_wp, 0.25_wp, 1.2984_wp, 1.0307_wp, 1.1530_wp), &
    & row_type(2, volume_linear, 4.015_wp, 1/3.0_wp, 1.3835_wp, 1.0979_wp, 1.2501_wp), &
    & row_type(3, volume_linear, 3.015_wp, 0.2_wp, 1.1806_wp, 1.0528_wp, 1.1933_wp), &
    & row_type(3, volume_linear, 3.015_wp, 0.25_wp, 1.2879_wp, 1.1130_wp, 1.3022_wp), &
    & row_type(3, volume_linear, 3.015_wp, 0.3_wp, 1.3848_wp, 1.1832_wp, 1.4076_wp), &
    & row_type(3, volume_linear, 3.015_wp, 1/3.0_wp, 1.4341_wp, 1.2272_wp, 1.4643_wp), &
    & row_type(3, volume_linear, 3.015_wp, 0.4_wp, 1.8066_wp, 1.3369_wp, 1.4056_wp)]
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
    real(wp) :: ratio
    integer :: i

    largest = 0.0_wp
    mean = 0.0_wp
    diagonal = 0.0_wp
    found = .false.
    if (law%has_factors()) return
    ! without a dilatation surface factors multiply all forces alike
    if (.not. subject%corrected .and. abs(law%material%a) > 0.0_wp) return
    ratio = law%material%poissons_ratio
    if (subject%dim == 2 .and. subject%plane_strain) ratio = ratio/(1 - ratio)
    do i = 1, size(rows)
      row = rows(i)
      if (row%dim /= subject%dim .or. row%volume /= subject%rule%kind) cycle
      if (abs(row%horizon - subject%rule%delta) > same) cycle
      if (abs(row%poissons_ratio - ratio) > same) cycle
      largest = row%largest
      mean = row%mean
      diagonal = row%diagonal
      found = .true.
      return
    end do
  end subroutine look_up

end module pd_set_up_toughness_table
