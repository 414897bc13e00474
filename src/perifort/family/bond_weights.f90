!> Weights of single bonds, Gb of the stretch and Gd of the dilatation, in the order of `bonds_of`.
!> Slots whose bonds stand in the same order with the same weights share a row.
module pd_family_bond_weights
  use pd_base_kinds, only: wp, i4, i8
  implicit none (type, external)
  private
  public :: bond_weights_type

  type :: bond_weights_type
    integer(i4), allocatable :: row(:)    !! (n_slots) row of each slot; 0: no bonds
    integer(i8), allocatable :: start(:)  !! (rows) place before the first weight of each row
    real(wp), allocatable :: Gb(:)        !! factors of the stretches [-]
    real(wp), allocatable :: Gd(:)        !! factors of the dilatation [-]
  contains
    procedure :: before
    procedure :: bytes
  end type bond_weights_type

contains

  !> The place before the first weight of slot `k`: its `i`-th bond has Gb(before + i).
  pure integer(i8) function before(weights, k)
    class(bond_weights_type), intent(in) :: weights  !! made
    integer, intent(in) :: k                         !! slot with bonds
    before = weights%start(weights%row(k))
  end function before

  !> Memory [bytes].
  pure integer(i8) function bytes(weights)
    class(bond_weights_type), intent(in) :: weights  !! made or not
    bytes = 0_i8
    if (.not. allocated(weights%row)) return
    bytes = 4_i8*size(weights%row) + 8_i8*size(weights%start) + 16*size(weights%Gb, kind=i8)
  end function bytes

end module pd_family_bond_weights
